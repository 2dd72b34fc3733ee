#include "meshing/small_handles.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "meshing/corners.h"

namespace isotrack {
namespace {

/// The piece of the mesh around one vertex after the other.
class Piece {
public:
    Piece(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles, const Corners& corners)
        : points_(points), triangles_(triangles), corners_(corners), in_(points.size(), 0) {}

    int euler(int middle, double reach) {
        inside_.assign(1, middle);
        in_[middle] = 1;
        int edges = 0, faces = 0;  // each once per corner, edges in the direction they have in one triangle
        for (std::size_t i = 0; i < inside_.size(); ++i)
            for_each_triangle(inside_[i], [&](int, int next, int) {
                if (in_[next] || (points_[next] - points_[middle]).squaredNorm() > reach * reach) return;
                in_[next] = 1;
                inside_.push_back(next);
            });
        for (const int v : inside_)
            for_each_triangle(v, [&](int, int next, int after) {
                edges += in_[next];
                faces += in_[next] && in_[after];
            });
        for (const int v : inside_) in_[v] = 0;
        return static_cast<int>(inside_.size()) - edges / 2 + faces / 3;
    }

private:
    template <typename Visit>
    void for_each_triangle(int v, const Visit& visit) const {
        for (int c = corners_.first[v]; c < corners_.first[v + 1]; ++c) {
            const int corner = corners_.corner[c];
            const Triangle& t = triangles_[corner / 3];
            visit(v, t[(corner + 1) % 3], t[(corner + 2) % 3]);
        }
    }

    const std::vector<Vec3>& points_;
    const std::vector<Triangle>& triangles_;
    const Corners& corners_;
    std::vector<char> in_;
    std::vector<int> inside_;
};

}  // namespace

std::vector<int> small_handles(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                               const std::vector<char>& looked_at, double reach) {
    if (std::find(looked_at.begin(), looked_at.end(), 1) == looked_at.end()) return {};
    const Corners corners(points.size(), triangles);
    tbb::enumerable_thread_specific<Piece> pieces([&] { return Piece(points, triangles, corners); });
    std::vector<int> euler(points.size(), 1);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 256), [&](const auto& range) {
        Piece& piece = pieces.local();
        for (std::size_t v = range.begin(); v < range.end(); ++v)
            if (looked_at[v]) euler[v] = piece.euler(static_cast<int>(v), reach);
    });
    std::vector<int> result;
    for (std::size_t v = 0; v < points.size(); ++v)
        if (euler[v] <= 0) result.push_back(static_cast<int>(v));
    std::stable_sort(result.begin(), result.end(), [&](int v, int w) { return euler[v] < euler[w]; });
    return result;
}

}  // namespace isotrack
