#include "meshing/lightening.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "component_boxes.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/replacing.h"
#include "meshing/sharpness.h"
#include "meshing/triangle_boxes.h"
#include "meshing/triangle_tree.h"

namespace isotrack {
namespace {

class Lightening {
public:
    Lightening(const std::vector<Vec3>& points, std::vector<Triangle>& triangles,
               const std::vector<char>& may_go, const Surface& surface,
               const std::vector<const CrossingGrid*>& reached, double tolerance, double detail)
        : points_(points),
          triangles_(triangles),
          mesh_{points, triangles, tolerance, detail, reached},
          probe_(surface.probe()),
          around_(points.size()),
          refused_(points.size(), 0.0f),
          result_{std::vector<char>(triangles.size(), 0), std::vector<char>(triangles.size(), 0)} {
        // All that comes is between corners of triangles with a vertex that may go: what it may cross is near
        // these.
        std::vector<char> at_patch(points.size(), 0);
        std::vector<Triangle> patches;
        for (const Triangle& t : triangles) {
            if (!may_go[t[0]] && !may_go[t[1]] && !may_go[t[2]]) continue;
            patches.push_back(t);
            for (const int v : t) at_patch[v] = 1;
        }
        for (std::size_t t = 0; t < triangles.size(); ++t)
            for (const int v : triangles[t])
                if (at_patch[v]) around_[v].push_back(static_cast<int>(t));
        const TriangleTree tree(points, triangles);
        std::vector<int> near;
        for (const Box& box : component_boxes(points, patches)) {
            const std::vector<int> some = tree.meeting(box);
            near.insert(near.end(), some.begin(), some.end());
        }
        std::sort(near.begin(), near.end());
        near.erase(std::unique(near.begin(), near.end()), near.end());
        boxes_.emplace(points, triangles, near);
    }

    /// Draws some vertices along edges no longer than `longest`, again where a neighbour was drawn meanwhile.
    /// Those that went are taken out of the list.
    void run(std::vector<int>& some, double longest) {
        std::vector<char> open(points_.size(), 0);
        for (const int v : some) open[v] = 1;
        for (bool again = true; again;) {
            again = false;
            for (const int v : some) {
                if (!open[v]) continue;
                open[v] = 0;
                const std::vector<int> ring = neighbours(v);
                if (!draw(v, ring, longest)) {
                    refused_[v] = static_cast<float>(longest);
                    continue;
                }
                for (const int w : ring) {
                    open[w] = 1;
                    refused_[w] = 0.0f;
                }
                again = true;
            }
            some.erase(std::remove_if(some.begin(), some.end(), [&](int v) { return around_[v].empty(); }),
                       some.end());
        }
    }
    Lightened take_result() { return std::move(result_); }

private:
    struct Target {
        double sharpness;  // the largest that comes
        int vertex;
    };

    std::vector<int> neighbours(int v) const {
        std::vector<int> result;
        for (const int t : around_[v])
            for (const int w : triangles_[t])
                if (w != v) result.push_back(w);
        std::sort(result.begin(), result.end());
        result.erase(std::unique(result.begin(), result.end()), result.end());
        return result;
    }
    static bool has(const Triangle& t, int v) { return t[0] == v || t[1] == v || t[2] == v; }
    static Triangle drawn(Triangle t, int v, int w) {
        std::replace(t.begin(), t.end(), v, w);
        return t;
    }
    /// Those of v that are left when it is drawn onto w.
    std::vector<Triangle> coming(int v, int w) const {
        std::vector<Triangle> result;
        for (const int t : around_[v])
            if (!has(triangles_[t], w)) result.push_back(drawn(triangles_[t], v, w));
        return result;
    }
    /// Whether a vertex and w, in its ring, have no neighbours in common but those beyond the two triangles
    /// of their edge, and there is more than a tetrahedron [Dey et al. 1999, "Topology preserving edge
    /// contraction"].
    bool keeps_topology(int w, const std::vector<int>& ring) const {
        const std::vector<int> other = neighbours(w);
        std::vector<int> common;
        std::set_intersection(ring.begin(), ring.end(), other.begin(), other.end(),
                              std::back_inserter(common));
        return common.size() == 2 && (ring.size() > 3 || other.size() > 3);
    }
    double sharpness_of(const Triangle& t) const {
        return sharpness(points_[t[0]], points_[t[1]], points_[t[2]]);
    }
    /// The largest; infinite where one has no area.
    double sharpest_of(const std::vector<Triangle>& some) const {
        double result = 0.0;
        for (const Triangle& t : some) {
            const double sharp = sharpness_of(t);
            if (!std::isfinite(sharp)) return std::numeric_limits<double>::infinity();
            result = std::max(result, sharp);
        }
        return result;
    }

    bool draw(int v, const std::vector<int>& ring, double longest) {
        double most = kSharpnessAt22Degrees;
        for (const int t : around_[v]) most = std::max(most, sharpness_of(triangles_[t]));
        std::vector<Target> targets;
        for (const int w : ring) {
            const double length = (points_[w] - points_[v]).norm();
            if (length <= refused_[v] || length > longest || !keeps_topology(w, ring)) continue;
            const double sharpest = sharpest_of(coming(v, w));
            if (std::isfinite(sharpest) && sharpest <= most) targets.push_back({sharpest, w});
        }
        if (targets.empty()) return false;
        std::sort(targets.begin(), targets.end(), [](const Target& a, const Target& b) {
            return a.sharpness < b.sharpness || (a.sharpness == b.sharpness && a.vertex < b.vertex);
        });
        std::vector<int> beside;
        for (const int w : ring) beside.insert(beside.end(), around_[w].begin(), around_[w].end());
        const Replaced before = mesh_.replaced(around_[v], std::move(beside), *probe_);
        for (const Target& target : targets) {
            const std::vector<Triangle> comes = coming(v, target.vertex);
            std::vector<Places> places;
            for (const Triangle& t : comes) places.push_back(mesh_.places_of(t));
            if (!mesh_.may_have(places, before, *probe_) || crosses(v, comes)) continue;
            make(v, target.vertex);
            return true;
        }
        return false;
    }
    bool crosses(int v, const std::vector<Triangle>& comes) const {
        Box box;
        for (const Triangle& t : comes)
            for (const int w : t) box.extend(points_[w]);
        std::vector<Triangle> near;
        for (const int t : boxes_->meeting(box))
            if (!result_.gone[t] && !has(triangles_[t], v)) near.push_back(triangles_[t]);
        return any_cross(points_, comes, near);
    }
    void make(int v, int w) {
        for (const int t : around_[v]) {
            if (has(triangles_[t], w)) {
                result_.gone[t] = 1;
                for (const int u : triangles_[t])
                    if (u != v) around_[u].erase(std::find(around_[u].begin(), around_[u].end(), t));
            } else {
                triangles_[t] = drawn(triangles_[t], v, w);
                result_.changed[t] = 1;
                around_[w].push_back(t);
                boxes_->note(t);
            }
        }
        around_[v].clear();
    }

    const std::vector<Vec3>& points_;
    std::vector<Triangle>& triangles_;
    const ReplaceableMesh mesh_;
    const std::unique_ptr<Surface::Probe> probe_;
    std::optional<TriangleBoxes> boxes_;
    std::vector<std::vector<int>> around_;  // each vertex of a patch: the triangles that are left
    std::vector<float> refused_;            // along edges up to this length, since a neighbour was drawn
    Lightened result_;
};

}  // namespace

Lightened lighten(const std::vector<Vec3>& points, std::vector<Triangle>& triangles,
                  const std::vector<char>& may_go, const Surface& surface,
                  const std::vector<const CrossingGrid*>& reached, double tolerance, double detail) {
    constexpr double kFirst = 1.0, kMost = 64.0;  // resolutions: length of the edges
    Lightening lightening(points, triangles, may_go, surface, reached, tolerance, detail);
    std::vector<int> some;
    for (std::size_t v = 0; v < may_go.size(); ++v)
        if (may_go[v]) some.push_back(static_cast<int>(v));
    for (double longest = kFirst; longest <= kMost && !some.empty(); longest *= 2.0)
        lightening.run(some, longest * surface.resolution());
    return lightening.take_result();
}

}  // namespace isotrack
