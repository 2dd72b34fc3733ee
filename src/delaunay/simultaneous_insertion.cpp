#include "delaunay/simultaneous_insertion.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace isotrack {
namespace {

constexpr int kSlots = 512;   // that a worker takes at a time
constexpr int kAttempts = 4;  // to add a vertex where others are in the way
constexpr int kPart = 256;    // vertices, at least
constexpr int kPartsPerWorker = 4;

}  // namespace

SimultaneousInsertion::SimultaneousInsertion(const std::vector<Vec3>& points, Tetrahedra& cells,
                                             std::vector<char>& marks, std::vector<int>& free,
                                             std::size_t most, int threads)
    : points_(points),
      cells_(cells),
      marks_(marks),
      free_(free),
      workers_(std::min(threads, cell_mark::kMostWorkers)),
      used_(static_cast<int>(cells.size())) {
    const std::size_t size = std::max(cells.size(), std::min(most, Tetrahedra::kMostCells));
    for (const int slot : free_) marks[slot] = cell_mark::kFree;
    cells.vertices.resize(size);
    cells.links.resize(size);
    marks.resize(size, cell_mark::kFree);
}

std::size_t SimultaneousInsertion::slack(int threads) {
    return static_cast<std::size_t>(kSlots) * std::min(threads, cell_mark::kMostWorkers);
}

std::vector<int> SimultaneousInsertion::finish() {
    const auto size = static_cast<std::size_t>(used_);
    cells_.vertices.resize(size);
    cells_.links.resize(size);
    marks_.resize(size);
    std::vector<int> left;
    for (Worker& worker : workers_) {
        for (; worker.slot < worker.slots_end; ++worker.slot) worker.free.push_back(worker.slot);
        for (const int slot : worker.free) marks_[slot] = cell_mark::kFree;
        free_.insert(free_.end(), worker.free.begin(), worker.free.end());
        left.insert(left.end(), worker.left.begin(), worker.left.end());
    }
    return left;
}

bool SimultaneousInsertion::add(const int* begin, const int* end) {
    const auto count = end - begin;
    const auto workers = static_cast<std::ptrdiff_t>(workers_.size());
    const auto parts = std::clamp<std::ptrdiff_t>(count / kPart, 1, kPartsPerWorker * workers);
    std::atomic<std::ptrdiff_t> next{0};
    const auto work = [&](int number) {
        Worker& worker = workers_[number];
        for (std::ptrdiff_t part; (part = next++) < parts;) {
            const int* const part_end = begin + (part + 1) * count / parts;
            for (const int* v = begin + part * count / parts; v < part_end; ++v)
                if (!add(*v, number, worker)) worker.left.push_back(*v);
        }
    };
    tbb::parallel_for(
        tbb::blocked_range<int>(0, static_cast<int>(workers), 1),
        [&](const auto& range) {
            for (int number = range.begin(); number < range.end(); ++number) work(number);
        },
        tbb::simple_partitioner());
    return std::none_of(workers_.begin(), workers_.end(), [](const Worker& worker) { return worker.twice; });
}

/// A seized cell that has the place of p in it.
int SimultaneousInsertion::locate(SharedInsertion& insertion, const Vec3& p, Worker& worker) const {
    const int used = used_;
    for (int looked_at = 0; looked_at < used; ++looked_at) {
        if (insertion.is_unseen(worker.near)) return insertion.locate(p, worker.near);
        if (++worker.near == used) worker.near = 0;
    }
    return SharedInsertion::kBlocked;
}

/// So many as the rim has facets. False where there are no more.
bool SimultaneousInsertion::take_slots(Worker& worker) {
    const std::size_t count = worker.room.rim.size();
    std::vector<int>& fresh = worker.room.fresh;
    fresh.clear();
    while (fresh.size() < count) {
        if (!worker.free.empty()) {
            fresh.push_back(worker.free.back());
            worker.free.pop_back();
            continue;
        }
        if (worker.slot == worker.slots_end) {
            int used = used_;
            do {
                if (used + kSlots > static_cast<int>(cells_.size())) {
                    worker.free.insert(worker.free.end(), fresh.begin(), fresh.end());
                    return false;
                }
            } while (!used_.compare_exchange_weak(used, used + kSlots));
            worker.slot = used;
            worker.slots_end = used + kSlots;
        }
        fresh.push_back(worker.slot++);
    }
    return true;
}

/// False where it could not be added.
bool SimultaneousInsertion::add(int vertex, int number, Worker& worker) {
    const Vec3& p = points_[vertex];
    SharedMarks marks(marks_.data(), number);
    SharedInsertion insertion(points_, cells_, marks, worker.room);
    for (int attempt = 0; attempt < kAttempts && !worker.full; ++attempt) {
        const int cell = locate(insertion, p, worker);
        if (cell == SharedInsertion::kBlocked) continue;
        if (insertion.vertex_at(p, cell) >= 0) {
            marks.release(cell);
            worker.twice = true;
            return true;
        }
        if (!insertion.dig(vertex, cell)) continue;
        if (!take_slots(worker)) {
            insertion.give_up();
            worker.full = true;
            return false;
        }
        insertion.fill(vertex);
        worker.free.insert(worker.free.end(), worker.room.freed.begin(), worker.room.freed.end());
        worker.near = worker.room.fresh.front();
        return true;
    }
    return false;
}

}  // namespace isotrack
