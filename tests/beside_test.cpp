// Work beside other work: it is done once, and no exception is lost or ends the process.
#include "beside.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "parallel_for_each.h"

namespace isotrack {
namespace {

/// What `work` beside `other` and waiting for it throws; empty: nothing.
template <typename Work, typename Other>
std::string thrown(const Work& work, const Other& other) {
    try {
        Beside beside(work);
        other();
        beside.wait();
        beside.wait();
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return {};
}

void throw_mine() {
    throw std::runtime_error("mine");
}
void throw_beside() {
    throw std::runtime_error("beside");
}

TEST(Beside, DoesItOnceByAnyNumberOfThreads) {
    for (const std::size_t threads : {1, 2, 4}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        for (int round = 0; round < 50; ++round) {
            int done = 0;
            std::vector<int> both(1000, 0);
            EXPECT_EQ(thrown([&] { ++done; },
                             [&] { parallel_for_each(both.size(), 10, [&](std::size_t i) { ++both[i]; }); }),
                      "");
            EXPECT_EQ(done, 1);
            EXPECT_EQ(both, std::vector<int>(both.size(), 1));
        }
    }
}

TEST(Beside, HandsOnWhatIsThrownByEitherOrBoth) {
    for (const std::size_t threads : {1, 2}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        for (int round = 0; round < 200; ++round) {
            EXPECT_EQ(thrown(throw_beside, [] {}), "beside");
            EXPECT_EQ(thrown([] {}, throw_mine), "mine");
            EXPECT_EQ(thrown(throw_beside, throw_mine), "mine");
        }
    }
}

TEST(Beside, IsDoneBeforeAnExceptionComesPast) {
    for (int round = 0; round < 50; ++round) {
        bool done = false;
        EXPECT_EQ(thrown([&] { done = true; }, throw_mine), "mine");
        EXPECT_TRUE(done);
    }
}

}  // namespace
}  // namespace isotrack
