#include "gap/diagnose/ripple.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "dynamics/drive_model.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::gap {
namespace {

constexpr double noise_a = 0.2, ripple_a = 0.25, cycles_per_turn = 3;

robot::RobotModel nomad() {
  return *robot::parse_robot(made::vr::shipped_robots()[1].json_text);
}

struct Drive {
  telemetry::RecordingSet recordings;
  double power_w = 0;           // mean battery power
  double watts_per_ampere = 0;  // battery power per additional ampere in each motor
};

// A straight drive at `speed` of time [rad/s]. Currents are the model's plus `extra` of side, time and wheel
// angle.
Drive drive(const std::function<double(double)>& speed,
            const std::function<double(std::size_t, double, double)>& extra, std::uint64_t seed = 41) {
  const robot::RobotModel robot = nomad();
  const dynamics::DriveModel model(robot, {});
  constexpr double step_s = 0.02;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, noise_a);
  double angle_rad = 0, count = 0;
  Drive made;
  std::vector<telemetry::Recording> missions;
  for (int m = 0; m < 2; ++m) {
    missions.push_back(made::mission(150, 1 / step_s, [&](double t, signals::Sample& s) {
      dynamics::Instant at;
      at.wheel_speed_rad_s = {speed(t), speed(t)};
      at.wheel_acceleration_rad_s2.fill((speed(t + step_s) - speed(t - step_s)) / (2 * step_s));
      const auto flow = model.flow(at);
      angle_rad += speed(t) * step_s;
      s.wheel_velocity_rad_s = at.wheel_speed_rad_s;
      double power_w = robot.idle_power_w;
      for (const std::size_t k : {0u, 1u}) {
        s.motor_current_a[k] = flow.current_a[k] + extra(k, t, angle_rad) + noise(random);
        s.motor_voltage_v[k] = model.voltage_for(k, s.motor_current_a[k], at);
        power_w += s.motor_voltage_v[k] * s.motor_current_a[k];
        made.watts_per_ampere += s.motor_voltage_v[k] + robot.motor.resistance_ohm * s.motor_current_a[k];
      }
      s.battery_voltage_v = robot.battery.nominal_voltage_v;
      s.battery_current_a = power_w / s.battery_voltage_v;
      made.power_w += power_w;
      ++count;
    }));
    missions.back().mission_id += std::to_string(m);
    for (auto& s : missions.back().samples) s.utime_us += m * 1'000'000'000LL;
  }
  made.power_w /= count;
  made.watts_per_ampere /= count;
  made.recordings = *telemetry::make_recording_set(robot.robot_id, std::move(missions));
  return made;
}

double uneven(double t) {
  return 4 + 1.5 * std::sin(t / 2.1) + 0.8 * std::sin(t / 0.9 + 1);
}

TEST(FindRipple, FindsRippleAtItsFrequency) {
  const Drive d = drive(
      uneven, [](std::size_t, double, double angle) { return ripple_a * std::sin(cycles_per_turn * angle); });
  const auto ripple = find_ripple(d.recordings, nomad(), {}, true, 20);
  ASSERT_TRUE(ripple);
  EXPECT_NEAR(ripple->per_turn, cycles_per_turn, 0.13);
  EXPECT_GT(ripple->contrast, 5);
  const double share = 2 * std::numbers::inv_pi * ripple_a * d.watts_per_ampere / d.power_w;
  EXPECT_NEAR(ripple->power_share, share, 0.2 * share);
  EXPECT_LE(ripple->found_in, 1u);
}

TEST(FindRipple, FindsTimeRippleInSurrogates) {
  // At constant speed an oscillation in time resembles one of the wheel angle.
  const Drive d =
      drive([](double) { return 4.0; },
            [](std::size_t, double t, double) { return ripple_a * std::sin(4 * cycles_per_turn * t); });
  const auto ripple = find_ripple(d.recordings, nomad(), {}, true, 20);
  ASSERT_TRUE(ripple);
  EXPECT_NEAR(ripple->per_turn, cycles_per_turn, 0.13);
  EXPECT_GE(ripple->found_in, 18u);
}

TEST(FindRipple, ReturnsNothingForNoise) {
  int of_motors = 0, of_battery = 0;
  for (std::uint64_t seed = 100; seed < 120; ++seed) {
    const Drive d = drive(
        uneven, [](std::size_t, double, double) { return 0.0; }, seed);
    of_motors += find_ripple(d.recordings, nomad(), {}, true, 0).has_value();
    of_battery += find_ripple(d.recordings, nomad(), {}, false, 0).has_value();
  }
  EXPECT_EQ(of_motors, 0);
  // The battery's reading contains the noise of both motors, so a noise line is found occasionally.
  EXPECT_LE(of_battery, 2);
}

}  // namespace
}  // namespace joulecast::gap
