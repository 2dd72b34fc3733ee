#include "isotrack/tracking/tracker.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <unordered_set>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/error.h"
#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/convection.h"
#include "isotrack/meshing/fit.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/sampling/coordinate_descent.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/sampling/sizing.h"

namespace isotrack {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kColdRounds = 12, kWarmRounds = 2;
constexpr int kSweepsPerRound = 3;
constexpr int kSizingSteps = 3,
              kCertifySteps =
                  6;  // barycentric lattice of the error samples; multiples of 3 hold the centroid
constexpr double kSuspect =
    0.6;  // of the tolerance: above it a triangle's largest error is searched for between the samples
constexpr int kCertifyRounds = 12, kRelaxedCertifyRounds = 4;
constexpr int kFitSteps = 4;
constexpr double kAngleFloor = 2.0;  // resolutions: sharp edges are as round as the grid makes them
constexpr double kLeastSpacing =
    0.05;  // resolutions: for shreds of a single voxel, where nothing coarser closes

/// Adds the time from its construction to its destruction to a stage.
class StageTimer {
public:
    StageTimer(std::map<std::string, double>& seconds, const char* stage)
        : total_(seconds[stage]), start_(std::chrono::steady_clock::now()) {}
    ~StageTimer() {
        total_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

private:
    double& total_;
    std::chrono::steady_clock::time_point start_;
};

/// Everything that is derived from the particles' positions at one moment.
struct Build {
    Tetrahedra cells;
    CarvedSurface carved;
    Adjacency adjacency;
    std::vector<double> thickness;
    std::vector<Vec3> vertices;    ///< Of the mesh: fitted when asked for.
    std::vector<Vec3> on_surface;  ///< The same vertices before the fit.

    /// The triangles as particle indices, without those that stand on a midpoint.
    std::vector<Triangle> particle_triangles() const {
        std::vector<Triangle> result;
        for (const Triangle& t : carved.triangles) {
            const Triangle p = {carved.particle[t[0]], carved.particle[t[1]], carved.particle[t[2]]};
            if (p[0] >= 0 && p[1] >= 0 && p[2] >= 0) result.push_back(p);
        }
        return result;
    }
};

/// The distance to the nearest Delaunay neighbour that faces the other way.
std::vector<double> thickness_of(const Particles& particles, const Adjacency& adjacency) {
    std::vector<double> th(particles.size(), std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < particles.size(); ++i)
        for (const int j : adjacency.of(i))
            if (particles.normal[i].dot(particles.normal[j]) < 0.0)
                th[i] = std::min(th[i], (particles.position[i] - particles.position[j]).norm());
    return th;
}

/// The DT as the paper's descent sees it. The DT numbers its vertices as the particles are numbered.
class DelaunayNeighbours final : public MovingNeighbours {
public:
    explicit DelaunayNeighbours(const std::vector<Vec3>& points)
        : dt_(make_tetrahedralisation(UpdateStrategy::Lazy)) {
        dt_->assign(points);
    }
    void neighbours(int i, std::vector<int>& result) override { dt_->neighbours(i, result); }
    void moved(int i, const Vec3& to) override { dt_->move(i, to); }
    void added(int, const Vec3& at, int near) override { dt_->insert(at, near); }
    void removed(int i) override { dt_->remove(i); }
    void settle() override { dt_->settle(); }
    std::size_t relocated() const { return dt_->profile().relocated; }

private:
    std::unique_ptr<Tetrahedralisation> dt_;
};

/// Files hold floats: what is certified must be what is written.
void round_to_float(Particles& particles) {
    for (Vec3& p : particles.position) p = p.cast<float>().cast<double>();
}

}  // namespace

struct Tracker::Impl {
    TrackerOptions options;
    Particles particles;
    Id next_id = 0;

    explicit Impl(const TrackerOptions& o) : options(o) {
        if (!(o.tolerance > 0.0))
            throw OptionError("the tolerance must be a positive length, got " + std::to_string(o.tolerance));
        if (o.angle_deg && !(*o.angle_deg > 0.0 && *o.angle_deg <= 90.0))
            throw OptionError("the angle must be in (0, 90] degrees, got " + std::to_string(*o.angle_deg));
        if (o.min_edge && !(*o.min_edge > 0.0))
            throw OptionError("the smallest edge must be a positive length");
        if (o.max_edge && !(*o.max_edge > 0.0))
            throw OptionError("the largest edge must be a positive length");
        if (o.min_edge && o.max_edge && *o.min_edge > *o.max_edge)
            throw OptionError("the smallest edge is longer than the largest");
    }

    SizingLimits limits(const Surface& surface) const {
        SizingLimits l{};
        l.tolerance = options.tolerance;
        l.angle = options.angle_deg.value_or(default_angle_deg(options.method)) * kPi / 180.0;
        l.angle_floor = kAngleFloor * surface.resolution();
        l.min_edge = options.min_edge.value_or(0.5 * surface.resolution());
        l.max_edge = std::max(options.max_edge.value_or(40.0 * surface.resolution()), l.min_edge);
        return l;
    }

    /// Where each particle is expected on the new surface. A velocity field may be in a unit nobody knows and
    /// a motion may have turned round, so the guesses compete: the velocity field, the last displacement,
    /// standing still. The one that lands nearest to the surface wins, by its median over the particles; an
    /// earlier one wins unless a later one is clearly better.
    std::vector<Vec3> expected_positions(const Surface& surface, const Motion& motion) const {
        constexpr std::size_t kVoters = 2000;
        constexpr double kClearly = 0.8;
        const std::size_t n = particles.size(), step = 1 + n / kVoters;
        std::vector<std::vector<Vec3>> guesses;
        if (motion) {
            guesses.emplace_back(n);
            tbb::parallel_for(std::size_t{0}, n,
                              [&](std::size_t i) { guesses.back()[i] = motion(particles.position[i]); });
        }
        guesses.emplace_back(n);
        for (std::size_t i = 0; i < n; ++i) guesses.back()[i] = particles.position[i] + particles.velocity[i];
        guesses.push_back(particles.position);
        const auto probe = surface.probe();
        std::size_t winner = 0;
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t g = 0; g < guesses.size(); ++g) {
            std::vector<double> distances;
            for (std::size_t i = 0; i < n; i += step)
                distances.push_back(std::abs(probe->value(guesses[g][i])));
            if (distances.empty()) break;
            const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
            std::nth_element(distances.begin(), middle, distances.end());
            if (*middle < kClearly * least) {
                least = *middle;
                winner = g;
            }
        }
        return std::move(guesses[winner]);
    }

    /// Brings the particles to the new surface; drops those that find no way there or would change sides.
    std::size_t carry(const Surface& surface, const Motion& motion) {
        const std::size_t n = particles.size();
        std::vector<char> keep(n, 0);
        const std::vector<Vec3> expected = expected_positions(surface, motion);
        tbb::enumerable_thread_specific<std::unique_ptr<Surface::Probe>> probes(
            [&] { return surface.probe(); });
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 128), [&](const auto& range) {
            Surface::Probe& probe = *probes.local();
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const Vec3 old = particles.position[i];
                for (const Vec3& start : {expected[i], old}) {
                    const auto p = probe.project(start);
                    if (!p) continue;
                    const Vec3 n_new = probe.normal(*p);
                    if (!(n_new.dot(particles.normal[i]) > 0.0)) continue;
                    particles.position[i] = *p;
                    particles.normal[i] = n_new;
                    particles.velocity[i] = *p - old;
                    keep[i] = 1;
                    break;
                }
            }
        });
        particles.retain(keep);
        return n - particles.size();
    }

    Build build(const Surface& surface, std::map<std::string, double>& seconds) {
        Build b;
        {
            const StageTimer timer(seconds, "delaunay");
            round_to_float(particles);
            b.cells = tetrahedralise(particles.position);
            b.adjacency = vertex_adjacency(b.cells, particles.size());
            b.thickness = thickness_of(particles, b.adjacency);
        }
        {
            const StageTimer timer(seconds, "convect");
            const CellLabels labels =
                options.reconstruction == Reconstruction::Pure
                    ? pure_convection(b.cells, particles.position)
                    : guided_convection(b.cells, particles.position, particles.normal, surface);
            b.carved = carve(b.cells, labels, particles.position);
            std::size_t midpoint = 0;
            for (const int p : b.carved.particle)
                b.vertices.push_back(p >= 0
                                         ? particles.position[p]
                                         : Vec3(b.carved.midpoints[midpoint++].cast<float>().cast<double>()));
            b.on_surface = b.vertices;
        }
        if (options.fit) fit_vertices(b, surface, seconds);
        return b;
    }

    void fit_vertices(Build& b, const Surface& surface, std::map<std::string, double>& seconds) {
        const StageTimer timer(seconds, "fit");
        const auto probe = surface.probe();
        std::vector<Vec3> normals;
        for (std::size_t v = 0; v < b.vertices.size(); ++v) {
            const int p = b.carved.particle[v];
            normals.push_back(p >= 0 ? particles.normal[p] : probe->normal(b.vertices[v]));
        }
        fit(b.vertices, b.carved.triangles, normals, surface, kFitSteps);
        for (Vec3& v : b.vertices) v = v.cast<float>().cast<double>();
    }

    /// Puts fitted vertices back where their triangles cross others, a ring further each time, until none
    /// cross. Facets of a DT do not.
    static void undo_crossing_fits(Build& b) {
        TriangleMesh mesh;
        mesh.triangles = b.carved.triangles;
        std::vector<char> undo(b.vertices.size(), 0);
        for (bool any = true; any;) {
            mesh.points = b.vertices;
            any = false;
            const auto back = [&](int v) {
                undo[v] = 1;
                any = any || b.vertices[v] != b.on_surface[v];
            };
            for (const auto& pair : self_intersections(mesh))
                for (const int t : {pair.first, pair.second})
                    for (const int v : mesh.triangles[t]) back(v);
            if (!any && std::count(undo.begin(), undo.end(), 1) == 0) break;
            for (std::size_t v = 0; v < undo.size(); ++v)
                if (undo[v]) b.vertices[v] = b.on_surface[v];
            if (!any) break;
            const std::vector<char> ring = undo;
            for (const Triangle& t : mesh.triangles)
                if (ring[t[0]] || ring[t[1]] || ring[t[2]])
                    for (const int v : t) undo[v] = 1;
        }
    }

    void size(const Build& b, const Surface& surface, const SizingLimits& l) {
        SizingEvidence evidence;
        evidence.thickness = b.thickness;
        evidence.error.assign(particles.size(), -1.0);
        const auto errors = triangle_errors(b.vertices, b.carved.triangles, surface, kSizingSteps);
        for (std::size_t t = 0; t < errors.size(); ++t)
            for (const int v : b.carved.triangles[t])
                if (const int p = b.carved.particle[v]; p >= 0)
                    evidence.error[p] = std::max(evidence.error[p], errors[t].largest);
        update_spacing(particles, b.adjacency, evidence, l);
    }

    /// The newborn move like the neighbours that were there before; alone among newborn they rest.
    void inherit_velocities(const Adjacency& adjacency, Id first_new) {
        for (std::size_t i = 0; i < particles.size(); ++i) {
            if (particles.id[i] < first_new) continue;
            Vec3 sum = Vec3::Zero();
            int count = 0;
            for (const int j : adjacency.of(i)) {
                if (particles.id[j] >= first_new || !(particles.normal[i].dot(particles.normal[j]) > 0.0))
                    continue;
                sum += particles.velocity[j];
                ++count;
            }
            if (count > 0) particles.velocity[i] = sum / count;
        }
    }

    /// New particles where the mesh fails. Returns how many; 0 when it passes.
    std::size_t refine(const Build& b, const Surface& surface, const SizingLimits& l,
                       const std::vector<Surface::Crossing>& crossings) {
        std::vector<Shortage> shortages;
        const auto errors =
            triangle_errors(b.vertices, b.carved.triangles, surface, kCertifySteps, kSuspect * l.tolerance);
        for (std::size_t t = 0; t < errors.size(); ++t) {
            if (errors[t].largest <= l.tolerance) continue;
            double h = l.max_edge;
            for (const int v : b.carved.triangles[t])
                if (const int p = b.carved.particle[v]; p >= 0) h = std::min(h, particles.spacing[p]);
            shortages.push_back({errors[t].where, 0.7 * h});
        }
        const auto distances = crossing_distances(b.vertices, b.carved.triangles, crossings, l.tolerance);
        for (std::size_t c = 0; c < crossings.size(); ++c)
            if (!(distances[c] <= l.tolerance))
                shortages.push_back({crossings[c].point, 2.0 * surface.resolution()});
        for (std::size_t e = 0; e + 1 < b.carved.complex_edge_ends.size(); e += 2) {
            const int p = b.carved.complex_edge_ends[e], q = b.carved.complex_edge_ends[e + 1];
            shortages.push_back({0.5 * (particles.position[p] + particles.position[q]),
                                 0.7 * std::min(particles.spacing[p], particles.spacing[q])});
        }
        const double least = options.min_edge.value_or(kLeastSpacing * surface.resolution());
        return densify(particles, shortages, surface, least, next_id);
    }

    /// The errors of the mesh as it will be written, both ways.
    static void measure(const Build& b, const Surface& surface, const SizingLimits& l,
                        const std::vector<Surface::Crossing>& crossings, TrackedFrame& frame) {
        const StageTimer timer(frame.seconds, "certify");
        const auto errors =
            triangle_errors(b.vertices, b.carved.triangles, surface, kCertifySteps, kSuspect * l.tolerance);
        double sum = 0.0, weight = 0.0;
        for (std::size_t t = 0; t < errors.size(); ++t) {
            const auto& [i, j, k] = b.carved.triangles[t];
            const double area = (b.vertices[j] - b.vertices[i]).cross(b.vertices[k] - b.vertices[i]).norm();
            frame.max_error = std::max(frame.max_error, errors[t].largest);
            sum += area * errors[t].mean_square;
            weight += area;
        }
        double back = 0.0;
        std::size_t found = 0;
        for (const double d :
             crossing_distances(b.vertices, b.carved.triangles, crossings, 3.0 * l.tolerance)) {
            if (!std::isfinite(d)) continue;
            frame.max_error = std::max(frame.max_error, d);
            back += d * d;
            ++found;
        }
        frame.lost_crossings = crossings.size() - found;
        frame.rms_error = std::sqrt(
            std::max(weight > 0.0 ? sum / weight : 0.0, found > 0 ? back / static_cast<double>(found) : 0.0));
        frame.within_tolerance = frame.max_error <= l.tolerance && frame.lost_crossings == 0;
    }

    void sample(const Surface& surface, const SizingLimits& l, bool warm, TrackedFrame& frame);
    void sample_as_in_paper(const Surface& surface, const SizingLimits& l, bool warm, TrackedFrame& frame);
    TrackedFrame advance(const Surface& surface, const Motion& motion);
};

/// Rounds of: mesh, measure, size, relax, births and deaths. More of them the more particles are new.
void Tracker::Impl::sample(const Surface& surface, const SizingLimits& l, bool warm, TrackedFrame& frame) {
    auto& seconds = frame.seconds;
    const double fresh =
        particles.empty() ? 0.0 : static_cast<double>(frame.seeded) / static_cast<double>(particles.size());
    const int rounds =
        warm ? kWarmRounds +
                   static_cast<int>(std::lround(std::min(1.0, 4.0 * fresh) * (kColdRounds - kWarmRounds)))
             : kColdRounds;
    for (int round = 0; round < rounds; ++round) {
        const Build b = build(surface, seconds);
        {
            const StageTimer timer(seconds, "size");
            size(b, surface, l);
        }
        const StageTimer timer(seconds, "relax");
        frame.sweeps += relax(particles, b.adjacency, surface, kSweepsPerRound);
        if (round + 1 == rounds) break;
        const auto keep = uncrowded(particles, b.adjacency);
        fill_sparse(particles, b.particle_triangles(), surface, next_id);
        auto all = keep;
        all.resize(particles.size(), 1);
        particles.retain(all);
    }
}

void Tracker::Impl::sample_as_in_paper(const Surface& surface, const SizingLimits& l, bool warm,
                                       TrackedFrame& frame) {
    constexpr int kMostColdSweeps = 60, kMostWarmSweeps = 12;
    if (particles.empty()) return;
    const StageTimer timer(frame.seconds, "relax");
    DelaunayNeighbours structure(particles.position);
    CoordinateDescentOptions o;
    o.most_sweeps = warm ? kMostWarmSweeps : kMostColdSweeps;
    o.seed = options.seed;
    const std::size_t count = particles.size();
    const CoordinateDescentReport report = coordinate_descent(particles, structure, surface, l, next_id, o);
    frame.sweeps = static_cast<int>(report.steps / std::max<std::size_t>(1, count));
    frame.relocated = structure.relocated();
}

TrackedFrame Tracker::Impl::advance(const Surface& surface, const Motion& motion) {
    TrackedFrame frame;
    auto& seconds = frame.seconds;
    frame.delaunay_strategy = name_of(UpdateStrategy::Rebuild);
    const SizingLimits l = limits(surface);
    const std::vector<Id> before = particles.id;
    const bool warm = !particles.empty();
    const Id first_new = next_id;
    {
        const StageTimer timer(seconds, "carry");
        frame.lost = carry(surface, motion);
    }
    {
        const StageTimer timer(seconds, "cover");
        frame.seeded = cover(particles, surface, l, options.seed, next_id);
    }
    if (options.method == Method::Paper)
        sample_as_in_paper(surface, l, warm, frame);
    else
        sample(surface, l, warm, frame);
    const std::vector<Surface::Crossing> crossings = surface.crossings();
    const auto build_to_check = [&] {
        Build built = build(surface, seconds);
        const StageTimer timer(seconds, "certify");
        if (options.fit) undo_crossing_fits(built);
        return built;
    };
    Build b = build_to_check();
    const int certify_rounds = options.method == Method::Paper ? 0 : kCertifyRounds;
    for (int round = 0; round < certify_rounds; ++round) {
        std::size_t added = 0;
        {
            const StageTimer timer(seconds, "certify");
            added = refine(b, surface, l, crossings);
        }
        if (added == 0) break;
        if (round < kRelaxedCertifyRounds)
            frame.sweeps += relax(particles, build(surface, seconds).adjacency, surface, 2);
        b = build_to_check();
    }

    measure(b, surface, l, crossings, frame);
    inherit_velocities(b.adjacency, first_new);

    frame.mesh.points = b.vertices;
    frame.mesh.triangles = b.carved.triangles;
    std::vector<char> seen(particles.size(), 0);
    for (std::size_t v = 0; v < b.vertices.size(); ++v) {
        const int p = b.carved.particle[v];
        const bool own = p >= 0 && !seen[p];
        if (own) seen[p] = 1;
        frame.mesh.ids.push_back(own ? particles.id[p] : next_id++);
        frame.mesh.velocities.push_back(p >= 0 ? particles.velocity[p] : Vec3::Zero());
    }
    frame.particles = particles.size();
    const std::unordered_set<Id> now(particles.id.begin(), particles.id.end());
    for (const Id id : particles.id) frame.born += id >= first_new;
    for (const Id id : before) frame.died += now.count(id) == 0;
    return frame;
}

double default_angle_deg(Method method) {
    return method == Method::Paper ? 20.0 : 60.0;
}

Tracker::Tracker(const TrackerOptions& options) : impl_(std::make_unique<Impl>(options)) {}
Tracker::~Tracker() = default;
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;
TrackedFrame Tracker::advance(const Surface& surface, const Motion& motion) {
    return impl_->advance(surface, motion);
}
const Particles& Tracker::particles() const {
    return impl_->particles;
}

}  // namespace isotrack
