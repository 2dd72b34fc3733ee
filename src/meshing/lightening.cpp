#include "meshing/lightening.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "component_boxes.h"
#include "disjoint_sets.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/replacing.h"
#include "meshing/sharpness.h"
#include "meshing/triangle_boxes.h"
#include "meshing/triangle_tree.h"
#include "numbers_below.h"
#include "parallel_for_each.h"

namespace isotrack {
namespace {

/// Vertices that may go, and the triangles that what comes there may cross.
struct LightenedPatch {
    std::vector<int> may_go, near;  // ascending
};

/// All that comes is between corners of triangles with a vertex that may go: `components` of these. Those
/// whose boxes meet are of one patch, so that no patch changes a triangle that another changes or looks at.
std::vector<LightenedPatch> independent_patches(const std::vector<Vec3>& points,
                                                const std::vector<Triangle>& triangles,
                                                const std::vector<char>& may_go,
                                                const ComponentBoxes& components) {
    const auto& [boxes, of_vertex] = components;
    const auto low_x = [&boxes = boxes](int c) { return boxes[c].min().x(); };
    std::vector<int> by_x = numbers_below(boxes.size());
    std::stable_sort(by_x.begin(), by_x.end(), [&](int c, int d) { return low_x(c) < low_x(d); });
    DisjointSets meeting(boxes.size());
    for (auto c = by_x.begin(); c != by_x.end(); ++c)
        for (auto d = c + 1; d != by_x.end() && low_x(*d) <= boxes[*c].max().x(); ++d)
            if (boxes[*d].intersects(boxes[*c])) meeting.join(*c, *d);
    std::vector<LightenedPatch> of_least(boxes.size());
    for (std::size_t v = 0; v < points.size(); ++v)
        if (may_go[v] && of_vertex[v] >= 0)
            of_least[meeting.least(of_vertex[v])].may_go.push_back(static_cast<int>(v));
    const TriangleTree tree(points, triangles);
    for (std::size_t c = 0; c < boxes.size(); ++c) {
        const std::vector<int> some = tree.meeting(boxes[c]);
        std::vector<int>& near = of_least[meeting.least(static_cast<int>(c))].near;
        near.insert(near.end(), some.begin(), some.end());
    }
    std::vector<LightenedPatch> result;
    for (LightenedPatch& patch : of_least) {
        if (patch.may_go.empty()) continue;
        std::sort(patch.near.begin(), patch.near.end());
        patch.near.erase(std::unique(patch.near.begin(), patch.near.end()), patch.near.end());
        result.push_back(std::move(patch));
    }
    return result;
}

class Lightening {
public:
    Lightening(const std::vector<Vec3>& points, std::vector<Triangle>& triangles,
               const ComponentBoxes& components, const Surface& surface,
               const std::vector<const CrossingGrid*>& reached, double tolerance, double detail)
        : points_(points),
          triangles_(triangles),
          surface_(surface),
          mesh_{points, triangles, tolerance, detail, reached},
          around_(points.size()),
          refused_(points.size(), 0.0f),
          open_(points.size(), 0),
          result_{std::vector<char>(triangles.size(), 0), std::vector<char>(triangles.size(), 0)} {
        for (std::size_t t = 0; t < triangles.size(); ++t)
            for (const int v : triangles[t])
                if (components.of_vertex[v] >= 0) around_[v].push_back(static_cast<int>(t));
    }

    /// Threads may call it at once, with independent patches.
    void lighten(LightenedPatch patch) {
        constexpr double kFirst = 1.0, kMost = 64.0;  // resolutions: length of the edges
        Own own{surface_.probe(), {points_, triangles_, patch.near}};
        for (double longest = kFirst; longest <= kMost && !patch.may_go.empty(); longest *= 2.0)
            draw_all(patch.may_go, longest * surface_.resolution(), own);
    }
    Lightened take_result() { return std::move(result_); }

private:
    /// What those who run at once do not share.
    struct Own {
        std::unique_ptr<Surface::Probe> probe;
        TriangleBoxes boxes;
    };
    struct Target {
        double sharpness;  // the largest that comes
        int vertex;
    };

    /// Draws some vertices along edges no longer than `longest`, again where a neighbour was drawn meanwhile.
    /// Those that went are taken out of the list.
    void draw_all(std::vector<int>& some, double longest, Own& own) {
        for (const int v : some) open_[v] = 1;
        for (bool again = true; again;) {
            again = false;
            for (const int v : some) {
                if (!open_[v]) continue;
                open_[v] = 0;
                const std::vector<int> ring = neighbours(v);
                if (!draw(v, ring, longest, own)) {
                    refused_[v] = static_cast<float>(longest);
                    continue;
                }
                for (const int w : ring) {
                    open_[w] = 1;
                    refused_[w] = 0.0f;
                }
                again = true;
            }
            some.erase(std::remove_if(some.begin(), some.end(), [&](int v) { return around_[v].empty(); }),
                       some.end());
        }
    }

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
        int common[2], count = 0;
        for (const int t : around_[w])
            for (const int u : triangles_[t]) {
                if (u == w || !std::binary_search(ring.begin(), ring.end(), u)) continue;
                if (std::find(common, common + count, u) != common + count) continue;
                if (count == 2) return false;
                common[count++] = u;
            }
        return count == 2 && (ring.size() > 3 || neighbours(w).size() > 3);
    }
    double sharpness_of(const Triangle& t) const {
        return sharpness(points_[t[0]], points_[t[1]], points_[t[2]]);
    }
    /// The largest of those of v that are left when it is drawn onto w, if it is no larger than `most`.
    std::optional<double> sharpest_coming(int v, int w, double most) const {
        double result = 0.0;
        for (const int t : around_[v]) {
            if (has(triangles_[t], w)) continue;
            const double sharp = sharpness_of(drawn(triangles_[t], v, w));
            if (!std::isfinite(sharp) || sharp > most) return std::nullopt;
            result = std::max(result, sharp);
        }
        return result;
    }

    bool draw(int v, const std::vector<int>& ring, double longest, Own& own) {
        double most = kSharpnessAt22Degrees;
        for (const int t : around_[v]) most = std::max(most, sharpness_of(triangles_[t]));
        std::vector<Target> targets;
        for (const int w : ring) {
            const double length = (points_[w] - points_[v]).norm();
            if (length <= refused_[v] || length > longest) continue;
            const std::optional<double> sharpest = sharpest_coming(v, w, most);
            if (sharpest && keeps_topology(w, ring)) targets.push_back({*sharpest, w});
        }
        if (targets.empty()) return false;
        std::sort(targets.begin(), targets.end(), [](const Target& a, const Target& b) {
            return a.sharpness < b.sharpness || (a.sharpness == b.sharpness && a.vertex < b.vertex);
        });
        std::vector<int> beside;
        for (const int w : ring) beside.insert(beside.end(), around_[w].begin(), around_[w].end());
        const Replaced before = mesh_.replaced(around_[v], std::move(beside), *own.probe);
        for (const Target& target : targets) {
            const std::vector<Triangle> comes = coming(v, target.vertex);
            std::vector<Places> places;
            for (const Triangle& t : comes) places.push_back(mesh_.places_of(t));
            if (!mesh_.may_have(places, before, *own.probe) || crosses(v, comes, own.boxes)) continue;
            make(v, target.vertex, own.boxes);
            return true;
        }
        return false;
    }
    bool crosses(int v, const std::vector<Triangle>& comes, const TriangleBoxes& boxes) const {
        Box box;
        for (const Triangle& t : comes)
            for (const int w : t) box.extend(points_[w]);
        std::vector<Triangle> near;
        for (const int t : boxes.meeting(box))
            if (!result_.gone[t] && !has(triangles_[t], v)) near.push_back(triangles_[t]);
        return any_cross(points_, comes, near);
    }
    void make(int v, int w, TriangleBoxes& boxes) {
        for (const int t : around_[v]) {
            if (has(triangles_[t], w)) {
                result_.gone[t] = 1;
                for (const int u : triangles_[t])
                    if (u != v) around_[u].erase(std::find(around_[u].begin(), around_[u].end(), t));
            } else {
                triangles_[t] = drawn(triangles_[t], v, w);
                result_.changed[t] = 1;
                around_[w].push_back(t);
                boxes.note(t);
            }
        }
        around_[v].clear();
    }

    const std::vector<Vec3>& points_;
    std::vector<Triangle>& triangles_;
    const Surface& surface_;
    const ReplaceableMesh mesh_;
    std::vector<std::vector<int>> around_;  // each vertex of a component: the triangles that are left
    std::vector<float> refused_;            // along edges up to this length, since a neighbour was drawn
    std::vector<char> open_;                // vertices that are to be looked at
    Lightened result_;
};

}  // namespace

Lightened lighten(const std::vector<Vec3>& points, std::vector<Triangle>& triangles,
                  const std::vector<char>& may_go, const Surface& surface,
                  const std::vector<const CrossingGrid*>& reached, double tolerance, double detail) {
    std::vector<Triangle> may_change;
    for (const Triangle& t : triangles)
        if (may_go[t[0]] || may_go[t[1]] || may_go[t[2]]) may_change.push_back(t);
    const ComponentBoxes components = component_boxes(points, may_change);
    std::vector<LightenedPatch> patches = independent_patches(points, triangles, may_go, components);
    Lightening lightening(points, triangles, components, surface, reached, tolerance, detail);
    parallel_for_each(patches.size(), 1, [&](std::size_t p) { lightening.lighten(std::move(patches[p])); });
    return lightening.take_result();
}

}  // namespace isotrack
