#include <gtest/gtest.h>

#include "ingest/fleet_view.h"

namespace joulecast::ingest {
namespace {

RobotSnapshot recent_snapshot(const std::string& robot_id, std::int64_t utime_us, double power_w) {
  RobotSnapshot made;
  made.robot_id = robot_id;
  made.samples = 1;
  made.sample.utime_us = utime_us;
  made.measured_power_w = power_w;
  return made;
}

constexpr std::int64_t recent_second_us = 1'000'000;

TEST(RecentValues, KeepsNinetySecondsPerRobot) {
  RecentValues recent;
  EXPECT_TRUE(recent.of("a").empty());
  for (std::int64_t k = 1; k <= 250; ++k)
    recent.take(recent_snapshot("a", k * recent_second_us, static_cast<double>(k)));
  recent.take(recent_snapshot("b", 7 * recent_second_us, 3));
  const auto values = recent.of("a");
  ASSERT_EQ(values.size(), 90u);
  EXPECT_EQ(values.front().utime_us, 161 * recent_second_us);
  for (std::size_t k = 0; k < values.size(); ++k)
    EXPECT_EQ(values[k].measured_power_w, static_cast<double>(161 + k));
  EXPECT_EQ(recent.of("b").size(), 1u);
}

TEST(RecentValues, TakesOneASecond) {
  RecentValues recent;
  for (std::int64_t k = 0; k < 100; ++k)
    recent.take(recent_snapshot("a", recent_second_us + k * recent_second_us / 10, 1));
  EXPECT_LE(recent.of("a").size(), 12u);
  EXPECT_GE(recent.of("a").size(), 9u);
}

TEST(RecentValues, OmitsValuesBeforeTheWindow) {
  RecentValues recent;
  recent.take(recent_snapshot("a", 1 * recent_second_us, 1));
  recent.take(recent_snapshot("a", 500 * recent_second_us, 2));
  recent.take(recent_snapshot("a", 501 * recent_second_us, 3));
  const auto values = recent.of("a");
  ASSERT_EQ(values.size(), 2u);
  EXPECT_EQ(values.front().measured_power_w, 2);
}

TEST(RecentValues, StepBackClearsTheValues) {
  RecentValues recent;
  for (std::int64_t k = 100; k < 110; ++k) recent.take(recent_snapshot("a", k * recent_second_us, 1));
  recent.take(recent_snapshot("a", 50 * recent_second_us, 2));
  ASSERT_EQ(recent.of("a").size(), 1u);
  recent.take(recent_snapshot("a", 51 * recent_second_us, 3));
  EXPECT_EQ(recent.of("a").size(), 2u);
}

TEST(RecentValues, OmitsRecalledAndForgottenRobots) {
  RecentValues recent;
  RobotSnapshot recalled = recent_snapshot("a", recent_second_us, 1);
  recalled.samples = 0;
  recent.take(recalled);
  EXPECT_TRUE(recent.of("a").empty());
  recent.take(recent_snapshot("a", recent_second_us, 1));
  recent.take(recent_snapshot("b", recent_second_us, 1));
  recent.keep([](const std::string& id) { return id == "b"; });
  EXPECT_TRUE(recent.of("a").empty());
  EXPECT_EQ(recent.of("b").size(), 1u);
}

}  // namespace
}  // namespace joulecast::ingest
