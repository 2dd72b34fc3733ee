// Vertices that several threads add to one DT.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

#include "delaunay/insertion.h"

namespace isotrack {

/// Adds vertices to a DT by several threads: each seizes the cells that it reads, and gives them up where
/// another is at one of them. Which slots cells get depends on the hour, the DT itself on the points alone.
/// Until `finish`, and without it, the arrays are of no use to others. Takes 4 bytes a point and thread
/// meanwhile.
class SimultaneousInsertion {
public:
    /// Of the points, cells and marks of a DT, and of its slots that are free. `most`: cells that it may come
    /// to have. `threads`: at most so many add vertices.
    SimultaneousInsertion(const std::vector<Vec3>& points, Tetrahedra& cells, std::vector<char>& marks,
                          std::vector<int>& free, std::size_t most, int threads);
    /// Slots that may be left unused.
    static std::size_t slack(int threads);

    /// Adds those from `begin` to `end`. Neighbours in this order should be so in space. False where one was
    /// found on the place of another: it is left out, and who was first depends on the hour. One of those
    /// that `finish` returns may be so, too.
    bool add(const int* begin, const int* end);
    /// Gives back the slots that are not used. Returns those that could not be added: others were in the way,
    /// or there was no room.
    std::vector<int> finish();

private:
    using SharedInsertion = Insertion<SharedMarks>;
    struct Worker {
        InsertionRoom room;
        std::vector<int> free;        // slots that its cells went from
        int slot = 0, slots_end = 0;  // its own, not used so far
        int near = 0;
        bool full = false, twice = false;
        std::vector<int> left;
    };

    bool add(int vertex, int number, Worker& worker);
    bool take_slots(Worker& worker);
    int locate(SharedInsertion& insertion, const Vec3& p, Worker& worker) const;

    const std::vector<Vec3>& points_;
    Tetrahedra& cells_;
    std::vector<char>& marks_;
    std::vector<int>& free_;
    std::vector<Worker> workers_;
    std::atomic<int> used_;  // slots
};

}  // namespace isotrack
