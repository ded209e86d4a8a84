#include "tests/study/ramp/ramp.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/planning/robots.h"
#include "tests/support/straight_power.h"

namespace joulecast::planning {
namespace {

LineTask task_of(double distance, double start = 0, double end = 0) {
  LineTask task{dynamics::straight_power(test::amr(), 20).over_distance(), distance, start, end};
  task.power.c0 += 24;
  return task;
}

TEST(Ramp, CoversDistanceInTime) {
  for (double fraction : {0.1, 1.0 / 3, 0.5}) {
    const auto ramp = ramp_in_time(task_of(7, 0.2, 0.1), 12, fraction);
    ASSERT_TRUE(ramp);
    EXPECT_NEAR(ramp->duration_s(), 12, 1e-12);
    EXPECT_NEAR(ramp->distance(), 7, 1e-12);
    const auto samples = ramp->sample(20001);
    double energy = 0;
    for (std::size_t k = 1; k < samples.size(); ++k) {
      energy +=
          0.5 * (samples[k].power_w + samples[k - 1].power_w) * (samples[k].time_s - samples[k - 1].time_s);
    }
    // Power jumps where the acceleration does: the trapezoid rule is off by one step of that jump.
    EXPECT_NEAR(ramp->energy_j(), energy, 1e-3 * energy);
    EXPECT_NEAR(samples.back().energy_j, ramp->energy_j(), 1e-9 * energy);
    EXPECT_NEAR(samples.back().distance, 7, 1e-9);
    EXPECT_NEAR(samples.back().speed, 0.1, 1e-9);
    EXPECT_NEAR(samples.front().speed, 0.2, 1e-9);
  }
}

TEST(Ramp, CostsMoreThanTheMinimum) {
  for (double distance : {0.5, 3.0, 20.0}) {
    const LineTask task = task_of(distance);
    const auto best = line_in_free_time(task);
    ASSERT_TRUE(best);
    for (double fraction : {0.25, 1.0 / 3, 0.5}) {
      EXPECT_GT(ramp_in_time(task, best->duration_s(), fraction)->energy_j(), best->energy_j());
      const auto own = ramp_in_free_time(task, fraction);
      ASSERT_TRUE(own);
      EXPECT_GT(own->energy_j(), best->energy_j());
      EXPECT_LE(own->energy_j(), ramp_in_time(task, best->duration_s(), fraction)->energy_j() * (1 + 1e-12));
      for (double factor : {0.9, 1.1}) {
        EXPECT_GT(ramp_in_time(task, factor * own->duration_s(), fraction)->energy_j(), own->energy_j());
      }
    }
  }
}

TEST(Ramp, LimitsGiveTrapezoidOrTriangle) {
  const auto longer = ramp_by_limits(task_of(10), 1, 0.5);
  ASSERT_TRUE(longer);
  EXPECT_NEAR(longer->duration_s(), 12, 1e-12);  // 2 + 8 + 2
  EXPECT_NEAR(longer->distance(), 10, 1e-12);
  const auto shorter = ramp_by_limits(task_of(1), 1, 0.5);
  ASSERT_TRUE(shorter);
  EXPECT_NEAR(shorter->peak_speed(), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(shorter->distance(), 1, 1e-12);
}

TEST(Ramp, ReportsTheFeasibleTime) {
  const auto slow = ramp_in_time(task_of(1, 0.5, 0.5), 100, 0.5);
  ASSERT_FALSE(slow);
  EXPECT_EQ(slow.error().fault, Fault::infeasible);
  EXPECT_NE(slow.error().message.find("at most 4.0"), std::string::npos);
  const auto close = ramp_by_limits(task_of(0.5, 1, 0), 1, 0.5);
  ASSERT_FALSE(close);
  EXPECT_EQ(close.error().field, "distance");
  EXPECT_NE(close.error().message.find("1.0"), std::string::npos);
  EXPECT_EQ(ramp_by_limits(task_of(5, 2, 0), 1, 0.5).error().field, "start_speed");
}

}  // namespace
}  // namespace joulecast::planning
