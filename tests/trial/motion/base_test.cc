#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/study/trial/motion/base_robot.h"
#include "tests/study/trial/motion/judged.h"
#include "tests/trial/motion/driven_log.h"

namespace joulecast::trial::motion {
namespace {

double plain_power(double v, double a, double yaw) {
  return 60 + 30 * std::fabs(v) + 40 * std::fabs(yaw) + 100 * v * a + 0.6 * std::pow(std::fabs(v), 3);
}

telemetry::Recording sampled(double rate_hz, double duration_s,
                             const std::function<double(std::size_t)>& current_a) {
  telemetry::Recording mission;
  for (std::size_t n = 0; n < static_cast<std::size_t>(rate_hz * duration_s); ++n) {
    signals::Sample s;
    s.utime_us = static_cast<std::int64_t>(1e6 * static_cast<double>(n) / rate_hz);
    s.wheel_velocity_rad_s = {1, 1};
    s.battery_voltage_v = 24;
    s.battery_current_a = current_a(n);
    mission.samples.push_back(s);
  }
  return mission;
}

TEST(BatteryChannels, FindsHoldOfTwoMotors) {
  // The motors are read in turn, two samples apart; a long rest has a constant value.
  virtual_robot::Rng rng(1);
  double right = 0, left = 0;
  const std::vector missions{sampled(20, 300, [&](std::size_t n) {
    if (n < 2000 && n % 20 == 0) right = 0.0625 * std::round(rng.uniform(0, 400));
    if (n < 2000 && n % 20 == 2) left = 0.0625 * std::round(rng.uniform(0, 400));
    return right + left;
  })};
  const BatteryChannels battery = battery_channels_of(missions);
  EXPECT_NEAR(battery.period_s, 1.0, 1e-9);
  EXPECT_NEAR(battery.current_step_a, 0.0625, 1e-9);
  EXPECT_EQ(battery.resistance_ohm, 0);
  const auto instants = instants_of(missions, neutral_kinematics().kinematics, battery.period_s);
  ASSERT_EQ(instants.size(), 1u);
  // The last of the two readings in each second; a rest is sampled at the same rate.
  EXPECT_EQ(instants[0][0].sample, 2u);
  EXPECT_EQ(instants[0][1].sample, 22u);
  EXPECT_NEAR(static_cast<double>(instants[0].size()), 300, 15);
}

TEST(BatteryChannels, CoarseValuesAreNotHeld) {
  virtual_robot::Rng rng(2);
  const std::vector missions{
      sampled(5, 400, [&](std::size_t) { return 0.1 * std::round(rng.uniform(0, 5)); })};
  const BatteryChannels battery = battery_channels_of(missions);
  EXPECT_NEAR(battery.period_s, 0.2, 1e-9);
  EXPECT_NEAR(battery.current_step_a, 0.1, 1e-9);
  EXPECT_EQ(instants_of(missions, neutral_kinematics().kinematics, battery.period_s)[0].size(), 2000u);
}

TEST(BatteryChannels, SeparatesResistanceFromDischarge) {
  virtual_robot::Rng rng(3);
  telemetry::Recording mission = sampled(10, 200, [&](std::size_t) { return rng.uniform(0, 20); });
  double charge_as = 0;
  for (signals::Sample& s : mission.samples) {
    charge_as += 0.1 * s.battery_current_a;
    s.battery_voltage_v = 48 - 0.05 * s.battery_current_a - 0.001 * charge_as;
  }
  EXPECT_NEAR(battery_channels_of(std::vector{mission}).resistance_ohm, 0.05, 0.001);
}

TEST(BasePower, FindsCoefficientsThroughGlitches) {
  virtual_robot::Rng rng(4);
  const MotionLog log = motion_log_of(driven_missions(2, 400, 1, [&](double v, double a, double yaw) {
    return plain_power(v, a, yaw) + rng.normal() + (rng.chance(0.01) ? 3000 : 0);
  }));
  const BaseFit fit = fit_log(log);
  EXPECT_TRUE(fit.form.turns && fit.form.fast);
  EXPECT_NEAR(fit.base[1], 30, 3);
  EXPECT_NEAR(fit.base[2], 40, 4);
  EXPECT_NEAR(fit.base[3], 100, 5);
  EXPECT_NEAR(fit.base[4], 0.6, 0.06);
  double sum = 0;
  for (const auto& of_mission : fit.residual_w) {
    for (const double r : of_mission) sum += r;
  }
  EXPECT_NEAR(sum / static_cast<double>(log.all_instants().size()), 0, 1e-6);
}

TEST(BasePower, OmitsUnidentifiableTerms) {
  const MotionLog log = motion_log_of(driven_missions(
      2, 200, 1, [](double v, double a, double) { return 60 + 30 * std::fabs(v) + 100 * v * a; }, 1));
  EXPECT_FALSE(fit_log(log).form.fast);
  EXPECT_EQ(fit_log(log).base[4], 0);
}

TEST(BasePower, RefereeExplainsItsForm) {
  const MotionLog log = motion_log_of(driven_missions(2, 400, 1, plain_power));
  const std::vector<Instant> instants = log.all_instants();
  const BaseFit fit = fit_log(log);
  std::vector<double> own_w, other_w;
  for (const Instant& at : instants) {
    own_w.push_back(base_power_w(fit.form, fit.base, at));
    other_w.push_back(own_w.back() + 100 * std::sin(at.driven_s / 20));
  }
  EXPECT_LT(referee_error(fit.form, instants, own_w), 0.002);
  EXPECT_GT(referee_error(fit.form, instants, other_w), 0.1);
}

TEST(BaseRobot, MatchesIndependentAndProductPower) {
  const MotionLog log = motion_log_of(driven_missions(2, 400, 1, plain_power));
  const BaseFit fit = fit_log(log);
  const robot::RobotModel file = base_robot(log, fit.form, fit.base);
  ASSERT_TRUE(robot::validate(file));
  const std::vector<Instant> instants = log.all_instants();
  EXPECT_LT(base_mismatch(file, fit.form, fit.base, instants), 0.005);
  const auto modelled_w = modelled_power_w(file, instants);
  ASSERT_TRUE(modelled_w) << describe(modelled_w.error());
  double apart = 0, total = 0;
  for (std::size_t n = 0; n < instants.size(); ++n) {
    apart += std::fabs((*modelled_w)[n] - file_power_w(file, instants[n]));
    total += std::fabs((*modelled_w)[n]);
  }
  EXPECT_LT(apart, 0.001 * total);
}

TEST(BaseRobot, FitsTurningScrub) {
  const MotionLog log = motion_log_of(driven_missions(2, 400, 1, [](double v, double a, double yaw) {
    return plain_power(v, a, yaw) + 2000 * std::fabs(yaw);
  }));
  const BaseFit fit = fit_log(log);
  const robot::RobotModel file = base_robot(log, fit.form, fit.base);
  ASSERT_EQ(file.effects.front().id, "turning_scrub");
  EXPECT_LE(file.effects.front().parameters.front().second, 1.5 + 1e-9);
  EXPECT_LT(base_mismatch(file, fit.form, fit.base, log.all_instants()), 0.005);
}

TEST(ReadMotionLog, RejectsUnsuitableLogs) {
  const auto folder = std::filesystem::temp_directory_path() / "joulecast-motion-poor";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  auto missions = driven_missions(1, 60, 1, plain_power);
  for (signals::Sample& s : missions[0].samples) {
    s.motor_current_a = {s.battery_current_a, s.battery_current_a};
    s.battery_voltage_v = s.battery_current_a = signals::unmeasured;
  }
  auto log = telemetry::EventLogWriter::create((folder / "poor.lcmlog").string());
  ASSERT_TRUE(log && telemetry::write_recording(*log, missions[0]) && log->close());
  const auto read = read_motion_log(folder / "poor.lcmlog");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().fault, Fault::infeasible);
  EXPECT_NE(describe(read.error()).find("poor.lcmlog: has 0 readings of battery power"), std::string::npos);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace joulecast::trial::motion
