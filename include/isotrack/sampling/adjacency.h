// Who is next to whom.
#pragma once

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace isotrack {

/// Neighbours of every particle: those of i are adjacent[first[i]] to adjacent[first[i + 1] - 1], ascending.
/// Symmetric, but for what `squared` of some makes.
struct Adjacency {
    std::vector<int> first{0};
    std::vector<int> adjacent;

    struct Range {
        const int *from, *to;
        const int* begin() const { return from; }
        const int* end() const { return to; }
        std::size_t size() const { return static_cast<std::size_t>(to - from); }
    };
    Range of(std::size_t i) const { return {adjacent.data() + first[i], adjacent.data() + first[i + 1]}; }
    std::size_t size() const { return first.size() - 1; }
    /// Of the particles whose flag is set, renumbered as `Particles::retain` does. Those around one that is
    /// left out become neighbours of each other.
    Adjacency restricted(const std::vector<char>& keep) const;
    /// Of `count` particles: `newborn` k, neighbour of three others, is number `size() + k`; the rest have no
    /// neighbours yet.
    Adjacency extended(const std::vector<std::array<int, 3>>& newborn, std::size_t count) const;
    /// Neighbours and their neighbours: of those whose flag is set, or of all if there are no flags; the
    /// others have none then, and may be neighbours of some all the same: they must not move meanwhile.
    Adjacency squared(const std::vector<char>& some = {}) const;
};

/// Of `count` particles, from directed pairs, which may repeat.
Adjacency from_pairs(const std::vector<std::pair<int, int>>& pairs, std::size_t count);

/// Which of `count` particles share an edge of a triangle.
Adjacency ring_of(const std::vector<std::array<int, 3>>& triangles, std::size_t count);

/// Particles with numbers in a row.
struct ParticleBlock {
    int begin, end;
};
/// Blocks of particles, of which all but the first are a neighbour of one before, at most `longest` (>= 1) in
/// each, in the groups of a colouring: none has a neighbour in another block of its group, so that the blocks
/// of a group can be treated at the same time. Particles that are next to each other in memory as in space
/// make long blocks, whose neighbours are still in the caches. Greedy in the order of the particles: the same
/// at any thread count. Blocks in which no particle's flag is set are left out of their group, which may be
/// empty then; without flags none is. With the lists of `squared(some)` a particle may have a neighbour
/// without a flag in another block of its group.
std::vector<std::vector<ParticleBlock>> colour_groups(const Adjacency& adjacency, int longest,
                                                      const std::vector<char>& some = {});

}  // namespace isotrack
