// The DT as coordinate descent asks for it.
#pragma once

#include <memory>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/coordinate_descent.h"

namespace isotrack {

/// A DT with the particles' numbers. Strategies that only note changes are settled when the descent says so;
/// the paper's two follow by themselves, and what lazy puts off stays put off.
class DelaunayNeighbours final : public MovingNeighbours {
public:
    DelaunayNeighbours(UpdateStrategy strategy, const std::vector<Vec3>& points)
        : dt_(make_tetrahedralisation(strategy)),
          notes_only_(strategy == UpdateStrategy::Rebuild || strategy == UpdateStrategy::Auto) {
        dt_->assign(points);
    }
    void neighbours(int i, std::vector<int>& result) override { dt_->neighbours(i, result); }
    void moved(int i, const Vec3& to) override { dt_->move(i, to); }
    void added(int, const Vec3& at, int near) override { dt_->insert(at, near); }
    void removed(int i) override { dt_->remove(i); }
    void settle() override {
        if (notes_only_) dt_->settle();
    }

    Tetrahedralisation& dt() { return *dt_; }

private:
    std::unique_ptr<Tetrahedralisation> dt_;
    bool notes_only_;
};

}  // namespace isotrack
