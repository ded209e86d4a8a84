#include "energy/back_test.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "robot/robot_file.h"

namespace joulecast::energy {
namespace {

using signals::Sample;

robot::RobotModel back_tested_nomad() {
  auto robot = robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/nomad.json");
  EXPECT_TRUE(robot) << describe(robot.error());
  return *robot;
}

robot::RobotModel with_friction(double factor) {
  robot::RobotModel robot = back_tested_nomad();
  for (double& torque : robot.motor.friction_torque_nm) torque *= factor;
  return robot;
}

// A run at 50 Hz of rising and falling speeds, with power by the robot's model and noise on the current.
std::vector<Sample> driven(const robot::RobotModel& robot, std::uint64_t seed, double payload_kg = 0) {
  const auto model = *dynamics::drive_model(robot);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 0.05);
  const double swing = 0.2 + 0.01 * static_cast<double>(seed);
  std::vector<Sample> run;
  for (int k = 0; k < 3000; ++k) {
    const double t = 0.02 * k;
    dynamics::Instant at;
    at.wheel_speed_rad_s = {4 + 2 * std::sin(swing * t), 4 + 2 * std::sin(swing * t + 0.3)};
    at.wheel_acceleration_rad_s2 = {2 * swing * std::cos(swing * t), 2 * swing * std::cos(swing * t + 0.3)};
    at.payload_kg = payload_kg;
    const auto flow = model.flow(at);
    Sample s;
    s.utime_us = 20'000LL * k;
    s.wheel_velocity_rad_s = at.wheel_speed_rad_s;
    s.motor_current_a = flow.current_a;
    s.motor_voltage_v = flow.voltage_v;
    s.battery_voltage_v = 24;
    s.battery_current_a = flow.battery_power_w / 24 + noise(random);
    s.payload_kg = payload_kg;
    run.push_back(s);
  }
  return run;
}

class BackTestTest : public ::testing::Test {
 protected:
  std::vector<DriveRun> runs() const { return {{"a", first_, 0}, {"b", second_, 0}}; }

  robot::RobotModel truth_ = with_friction(1.5);
  std::vector<Sample> first_ = driven(truth_, 1), second_ = driven(truth_, 2);
};

TEST_F(BackTestTest, BetterModelImproves) {
  const auto test = back_test(runs(), back_tested_nomad(), truth_);
  ASSERT_TRUE(test) << describe(test.error());
  ASSERT_EQ(test->runs.size(), 2U);
  EXPECT_TRUE(test->improves());
  for (std::size_t k = 0; k < 2; ++k) {
    const auto metered_before = *metered(back_tested_nomad(), runs()[k], {});
    const auto& run = test->runs[k];
    EXPECT_TRUE(run.at_battery);
    EXPECT_NEAR(run.measured_j, metered_before.measured_j, 1e-9 * run.measured_j);
    EXPECT_NEAR(run.before.energy_j, metered_before.modelled_j, 1e-9 * run.measured_j);
    EXPECT_NEAR(run.before.relative, metered_before.modelled_j / metered_before.measured_j - 1, 1e-9);
    // Noise of 0.05 A at 24 V on 3000 samples: 1.2 W * 60 s / sqrt(3000) = 1.3 J; four of them.
    EXPECT_NEAR(run.after.energy_j, run.measured_j, 4 * 1.3);
    EXPECT_LE(run.before.interval[0], run.before.relative);
    EXPECT_GE(run.before.interval[1], run.before.relative);
    EXPECT_LT(run.after.power_absolute_relative, run.before.power_absolute_relative);
  }
  EXPECT_GT(test->improvement_interval[0], 0);
  EXPECT_LE(test->improvement_interval[0], test->improvement());
  EXPECT_GE(test->improvement_interval[1], test->improvement());
}

TEST_F(BackTestTest, OtherModelsDoNotImprove) {
  EXPECT_FALSE(back_test(runs(), truth_, back_tested_nomad())->improves());
  robot::RobotModel absurd = truth_;
  absurd.motor.torque_constant_nm_a = 1e-200;
  EXPECT_EQ(back_test(runs(), truth_, absurd).error().fault, Fault::invalid);
  const auto same = back_test(runs(), back_tested_nomad(), back_tested_nomad());
  EXPECT_FALSE(same->improves());
  EXPECT_EQ(same->improvement(), 0);
}

// Too much friction and too much idle power in turn: the energy error of the model in force is small because
// its two errors cancel, the power is off at every instant.
TEST_F(BackTestTest, ReducedPowerGapSuffices) {
  robot::RobotModel cancelling = truth_;
  for (double& torque : cancelling.motor.friction_torque_nm) torque *= 0.9;
  const auto energy = [&](const robot::RobotModel& model, std::size_t run) {
    return metered(model, runs()[run], {})->modelled_j;
  };
  const double missing_j =
      energy(truth_, 0) + energy(truth_, 1) - energy(cancelling, 0) - energy(cancelling, 1);
  cancelling.idle_power_w += missing_j / (2 * 59.98);
  const auto test = back_test(runs(), cancelling, truth_);
  ASSERT_TRUE(test) << describe(test.error());
  EXPECT_LT(test->improvement_interval[0], 0);
  EXPECT_GT(test->power_gap_fall_interval[0], 0);
  EXPECT_LE(test->power_gap_fall_interval[0], test->power_gap_before - test->power_gap_after);
  EXPECT_GE(test->power_gap_fall_interval[1], test->power_gap_before - test->power_gap_after);
  EXPECT_TRUE(test->improves());
}

// Of three missions one is driven empty, where an effect of the payload changes nothing.
TEST_F(BackTestTest, AgreeingRunsDoNotDilute) {
  robot::RobotModel loaded = back_tested_nomad();
  loaded.effects.push_back({"load_rolling_resistance", {{"coefficient", 0.03}}});
  std::vector<DriveRun> given;
  std::vector<std::vector<Sample>> recorded;
  for (const double payload_kg : {0.0, 8.0, 8.0})
    recorded.push_back(driven(loaded, recorded.size() + 1, payload_kg));
  for (const auto& samples : recorded) given.push_back({"run", samples, samples.front().payload_kg});
  const auto test = back_test(given, back_tested_nomad(), loaded);
  ASSERT_TRUE(test) << describe(test.error());
  ASSERT_EQ(test->runs.size(), 3U);
  EXPECT_EQ(test->runs[0].before.energy_j, test->runs[0].after.energy_j);
  EXPECT_GT(test->improvement_interval[0], 0);
  EXPECT_TRUE(test->improves());
  // The interval is of the fall over all runs, the empty one included.
  EXPECT_LE(test->improvement_interval[0], test->improvement());
  EXPECT_GE(test->improvement_interval[1], test->improvement());
  given.resize(1);
  EXPECT_FALSE(back_test(given, back_tested_nomad(), loaded)->improves());
}

TEST_F(BackTestTest, UsesMotorsWithoutBattery) {
  for (auto* run : {&first_, &second_})
    for (Sample& s : *run) s.battery_current_a = signals::unmeasured;
  const auto test = back_test(runs(), back_tested_nomad(), truth_);
  ASSERT_TRUE(test) << describe(test.error());
  ASSERT_EQ(test->runs.size(), 2U);
  EXPECT_FALSE(test->runs[0].at_battery);
  EXPECT_TRUE(test->improves());
  EXPECT_NEAR(test->runs[0].after.relative, 0, 1e-4);
}

TEST_F(BackTestTest, OmitsBarelyMeasuredRuns) {
  first_.resize(200);
  for (Sample& s : second_) {
    s.battery_voltage_v = signals::unmeasured;
    s.motor_voltage_v[0] = signals::unmeasured;
  }
  const auto test = back_test(runs(), back_tested_nomad(), truth_);
  ASSERT_TRUE(test) << describe(test.error());
  EXPECT_TRUE(test->runs.empty());
  EXPECT_FALSE(test->improves());
  EXPECT_TRUE(std::isnan(test->improvement_interval[0]));
}

TEST_F(BackTestTest, StopsAndRejectsBadEffects) {
  BackTestSettings settings;
  settings.go_on = [] { return false; };
  EXPECT_EQ(back_test(runs(), back_tested_nomad(), truth_, settings).error().fault, Fault::conflict);
  robot::RobotModel odd = back_tested_nomad();
  odd.effects.push_back({"no_such_effect", {}});
  EXPECT_EQ(back_test(runs(), back_tested_nomad(), odd).error().fault, Fault::invalid);
}

}  // namespace
}  // namespace joulecast::energy
