#include "battery/discharge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support.h"

namespace joulecast::battery {
namespace {

using Kind = Load::Kind;

Load constant_load(Kind kind, double value, double duration_s) {
  return {kind, {{duration_s, value, value}}};
}

// From 0 to `value`.
Load ramp(Kind kind, double value, double duration_s) {
  return {kind, {{duration_s, 0, value}}};
}

TEST(Discharge, DeliversItsLoad) {
  const Circuit circuit(plain_battery());
  const auto out =
      discharge(circuit, Circuit::rested(1), constant_load(Kind::current, 5, 0.8 * 10 * 3600 / 5));
  ASSERT_TRUE(out) << describe(out.error());
  EXPECT_EQ(out->ending, Ending::load_ended);
  EXPECT_NEAR(out->state.charge, 0.2, 1e-7);
  EXPECT_NEAR(out->charge_ah, 8, 1e-6);
  EXPECT_NEAR(out->energy_j, 8 * 3600 * (24 - 0.5), 1);
}

// Charge falls with t²: 10 Ah at 0 to 10 A over 2 h; half of it after 2 h / sqrt 2.
TEST(Discharge, FollowsALinearRamp) {
  const Circuit circuit(plain_battery());
  const auto out =
      discharge(circuit, Circuit::rested(1), ramp(Kind::current, 10 / std::sqrt(2), 7200 / std::sqrt(2)));
  ASSERT_TRUE(out);
  EXPECT_NEAR(out->state.charge, 0.5, 1e-7);
}

// Open-circuit voltage falling straight with charge under constant power P: with u = U(s), E = 24 + 6 s,
// ds/dt = -I/Q and I = (u - sqrt(u² - 4 r P)) / (2 r), time is the integral of Q / (6 I(u)) du, taken here by
// Simpson's rule with 2000 pieces.
TEST(Discharge, FindsConstantPowerCutOff) {
  robot::Battery battery = plain_battery();
  battery.open_circuit_voltage = {{0, 20}, {1, 26}};
  battery.cutoff_voltage_v = 21;
  const Circuit circuit(battery);
  const double power_w = 200, r = 0.1;
  const double current_at_end = power_w / 21, u_end = 21 + r * current_at_end;
  const auto inverse = [&](double u) {
    return 36000 / (6 * (u - std::sqrt(u * u - 4 * r * power_w)) / (2 * r));
  };
  const int pieces = 2000;
  const double h = (26 - u_end) / pieces;
  double expected_s = inverse(u_end) + inverse(26);
  for (int i = 1; i < pieces; ++i) expected_s += (i % 2 == 1 ? 4 : 2) * inverse(u_end + i * h);
  expected_s *= h / 3;
  const auto out = discharge(circuit, Circuit::rested(1), constant_load(Kind::power, power_w, 1e5));
  ASSERT_TRUE(out);
  EXPECT_EQ(out->ending, Ending::voltage);
  EXPECT_NEAR(out->voltage_v, 21, 1e-6);
  EXPECT_NEAR(out->duration_s, expected_s, 1e-6 * expected_s);
  EXPECT_NEAR(out->energy_j, power_w * expected_s, 1e-6 * power_w * expected_s);
}

TEST(Discharge, EndsOnTooLargeJump) {
  const Circuit circuit(plain_battery());
  Load load{Kind::current, {{100, 1, 1}, {100, 141, 141}}};  // 24 V - 0.1 ohm * 141 A is below 10 V
  const auto by_voltage = discharge(circuit, Circuit::rested(1), load);
  ASSERT_TRUE(by_voltage);
  EXPECT_EQ(by_voltage->ending, Ending::voltage);
  EXPECT_EQ(by_voltage->duration_s, 100);
  EXPECT_EQ(by_voltage->time_s, std::vector<double>{100});
  load = {Kind::power, {{100, 1, 1}, {100, 1441, 1441}}};  // 24² / 0.4 = 1440 W is the most
  const auto by_power = discharge(circuit, Circuit::rested(1), load);
  ASSERT_TRUE(by_power);
  EXPECT_EQ(by_power->ending, Ending::power);
  EXPECT_EQ(by_power->duration_s, 100);
}

TEST(Discharge, FindsTheGreatestPower) {
  const Circuit circuit(plain_battery());
  DischargeLimits limits;
  limits.voltage_v = 0;
  const auto out = discharge(circuit, Circuit::rested(1), ramp(Kind::power, 2880, 10), limits);
  ASSERT_TRUE(out);
  EXPECT_EQ(out->ending, Ending::power);
  EXPECT_NEAR(out->duration_s, 5, 1e-6);
}

// CVODE and the closed step are two ways through the same circuit; without heat the step is exact, so they
// differ only by CVODE's tolerance (1e-7 a step).
TEST(Discharge, AgreesWithTheClosedStep) {
  robot::Battery battery = full_battery();
  battery.thermal_resistance_k_w = 0;
  const Circuit circuit(battery);
  const double time_s[] = {0, 130, 250, 900, 1000, 1300}, current_a[] = {0, 0, 3, -1, 4, 0.2};
  const auto out = discharge(circuit, Circuit::rested(0.9, 18), *held_load(Kind::current, time_s, current_a),
                             {std::nullopt, 18});
  ASSERT_TRUE(out);
  ASSERT_EQ(out->ending, Ending::load_ended);
  State state = Circuit::rested(0.9, 18);
  for (std::size_t i = 1; i < 6; ++i) {
    state = circuit.advanced(state, current_a[i], time_s[i] - time_s[i - 1], 18);
    EXPECT_EQ(out->time_s[i - 1], time_s[i]);
    EXPECT_NEAR(out->terminal_v[i - 1], circuit.voltage_v(state, current_a[i]), 2e-6);
  }
  EXPECT_NEAR(out->state.charge, state.charge, 1e-7);
}

// In a steady state the temperature is above the surroundings by R_T times the losses, and the power of the
// cells is the power at the terminals plus the losses.
TEST(Discharge, LossesHeatTheBattery) {
  robot::Battery battery = plain_battery();
  battery.thermal_resistance_k_w = 2;
  battery.thermal_time_constant_s = 300;
  const Circuit circuit(battery);
  const auto out =
      discharge(circuit, Circuit::rested(1, 10), constant_load(Kind::current, 5, 6000), {std::nullopt, 10});
  ASSERT_TRUE(out);
  EXPECT_NEAR(out->state.temperature_c, 10 + 2 * (0.1 * 25) * (1 - std::exp(-20)), 1e-3);
  EXPECT_NEAR(out->energy_j + 0.1 * 25 * 6000, 24 * 5 * 6000.0, 1);
}

TEST(Discharge, RejectsNonFiniteStart) {
  const Circuit circuit(plain_battery());
  State start = Circuit::rested(1);
  start.charge = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(discharge(circuit, start, constant_load(Kind::current, 1, 1)));
  const double time_s[] = {0, 1, 1}, nan_s[] = {0, start.charge, 2}, value[] = {1, 2, 3};
  EXPECT_EQ(held_load(Kind::power, time_s, value).error().field, "time_s");
  EXPECT_EQ(held_load(Kind::power, nan_s, value).error().field, "time_s");
  EXPECT_EQ(held_load(Kind::power, value, nan_s).error().field, "value");
}

}  // namespace
}  // namespace joulecast::battery
