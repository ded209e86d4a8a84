// How much of copper and braking telemetry loses, as for_operators.md states, against the states of a plant
// that shares no equation with the product: the ripple of its currents within a period of the controller is
// in no sample.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "energy/meter.h"
#include "robot/robot_file.h"
#include "tests/study/trial/foreign/foreign_case.h"

namespace joulecast::energy {
namespace {

using trial::foreign::ForeignState;

signals::Sample reading(const ForeignState& s, std::int64_t sequence) {
  signals::Sample sample;
  sample.utime_us = 1'750'000'000'000'000 + std::llround(s.time_s * 1e6);
  sample.sequence = sequence;
  sample.wheel_velocity_rad_s = s.wheel_rad_s;
  sample.motor_voltage_v = s.voltage_v;
  sample.motor_current_a = s.current_a;
  sample.battery_voltage_v = s.battery_voltage_v;
  sample.battery_current_a = s.battery_current_a;
  sample.payload_kg = 0;
  return sample;
}

TEST(SampleRate, LosesCopperAndBrakingAsStated) {
  constexpr double state_s = 5e-4;
  virtual_robot::Rng rng = virtual_robot::Rng::stream(11, 36);
  struct Loss {
    double hz, copper = 0, braking = 0, battery = 0;
  };
  std::vector<Loss> losses{{200}, {50}, {10}, {4}};
  double copper = 0, braking = 0, battery = 0;
  for (int k = 0; k < 8; ++k) {
    const auto robot = trial::foreign::draw_robot_file(rng);
    const auto file = robot::parse_robot(trial::foreign::robot_json_text(robot)).value();
    const auto drive = draw_drive(robot, 60, rng);
    const auto states = driven(robot, {}, drive, state_s, state_s);
    for (const ForeignState& s : states) {
      battery += state_s * s.battery_power_w;
      for (const std::size_t side : {0u, 1u}) {
        copper += state_s * file.motor.resistance_ohm * s.current_a[side] * s.current_a[side];
        braking += state_s * std::max(0.0, -s.current_a[side] * s.voltage_v[side]);
      }
    }
    for (Loss& loss : losses) {
      Meter meter(*dynamics::drive_model(file), {}, [](const MeterPoint&) {});
      const auto every = static_cast<std::size_t>(std::lround(1 / (loss.hz * state_s)));
      for (std::size_t i = 0; i < states.size(); i += every)
        ASSERT_TRUE(meter.add(reading(states[i], static_cast<std::int64_t>(i / every))));
      ASSERT_TRUE(meter.flush());
      const signals::Accounts a = meter.accounts();
      loss.copper += a.ledger[signals::Term::copper];
      loss.braking += a.ledger[signals::Term::braking];
      loss.battery += a.measured_j;
    }
  }
  for (const Loss& loss : losses) {
    SCOPED_TRACE(loss.hz);
    const double lost_copper = 1 - loss.copper / copper, lost_braking = 1 - loss.braking / braking;
    std::printf("%g Hz: copper -%.1f %%, braking -%.1f %%, battery %+.2f %%\n", loss.hz, 100 * lost_copper,
                100 * lost_braking, 100 * (loss.battery / battery - 1));
    const bool low = loss.hz < 10;
    EXPECT_NEAR(lost_copper, low ? 0.21 : 0.165, 0.015);
    EXPECT_NEAR(lost_braking, low ? 0.47 : 0.355, 0.02);
    EXPECT_NEAR(loss.battery / battery, 1, 0.005);
  }
}

}  // namespace
}  // namespace joulecast::energy
