#include "battery/circuit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support.h"

namespace joulecast::battery {
namespace {

constexpr State used{0.6, {1.5, 0.8}, {0.004, 0.01}, 31};

TEST(Circuit, VoltageFollowsItsFormula) {
  const robot::Battery battery = full_battery();
  const Circuit circuit(battery);
  const double factor = std::exp(2500 * (1 / (31 + 273.15) - 1 / 298.15));
  const double r = factor * (0.05 + (0.6 - 0.3) / 0.7 * (0.04 - 0.05));
  const double r_half = 0.05 + (0.5 - 0.3) / 0.7 * (0.04 - 0.05);
  const double surface = 0.6 - 0.014;
  const double open = 3.7 + (surface - 0.5) / 0.5 * 0.5;
  const double expected = open - r * (2 + (0.015 * 1.5 + 0.02 * 0.8) / r_half);
  EXPECT_NEAR(circuit.voltage_v(used, 2), expected, 1e-12);
  EXPECT_DOUBLE_EQ(circuit.capacity_ah(), 2.25);
}

TEST(Circuit, CurrentAtPowerIsConsistent) {
  const Circuit circuit(full_battery());
  const double most_w = circuit.most_power_w(used);
  for (const double share : {-2.0, -0.1, 0.0, 1e-12, 0.3, 0.999, 1.0}) {
    const double power_w = share * most_w;
    const auto current_a = circuit.current_at_power_a(used, power_w);
    ASSERT_TRUE(current_a) << share;
    // At the greatest power the root is double: half the digits are lost.
    EXPECT_NEAR(*current_a * circuit.voltage_v(used, *current_a), power_w, 1e-12 * most_w) << share;
    EXPECT_LE(*current_a,
              circuit.inner_voltage_v(used) / (2 * circuit.ohmic_resistance_ohm(used)) * (1 + 1e-9));
  }
  EXPECT_FALSE(circuit.current_at_power_a(used, most_w * (1 + 1e-9)));
  robot::Battery ideal = plain_battery();
  ideal.internal_resistance_ohm = 0;
  EXPECT_TRUE(std::isinf(Circuit(ideal).most_power_w(Circuit::rested(1))));
  EXPECT_DOUBLE_EQ(*Circuit(ideal).current_at_power_a(Circuit::rested(1), 48), 2);
}

// advanced() against its own rate: a central difference of the step, which is smooth in the duration.
TEST(Circuit, StepDerivativeIsTheRate) {
  const Circuit circuit(full_battery());
  const double h = 1e-3;
  for (const double current_a : {-3.0, 0.0, 4.0}) {
    const State rate = circuit.rate(used, current_a, 20);
    const State before = circuit.advanced(used, current_a, -h, 20);
    const State after = circuit.advanced(used, current_a, h, 20);
    // Error of the difference: h²/6 of the third derivative, at most (value / tau³), plus rounding over h.
    const double tolerance = 1e-9;
    EXPECT_NEAR((after.charge - before.charge) / (2 * h), rate.charge, tolerance);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_NEAR((after.branch_current_a[k] - before.branch_current_a[k]) / (2 * h),
                  rate.branch_current_a[k], tolerance);
      EXPECT_NEAR((after.charge_lag[k] - before.charge_lag[k]) / (2 * h), rate.charge_lag[k], tolerance);
    }
    EXPECT_NEAR((after.temperature_c - before.temperature_c) / (2 * h), rate.temperature_c, 1e-8);
  }
}

TEST(Circuit, ConstantCurrentStepsAddUp) {
  robot::Battery battery = full_battery();
  battery.thermal_time_constant_s.reset();  // with heat the factor would change between the halves
  const Circuit circuit(battery);
  const State whole = circuit.advanced(used, 2.5, 100, 20);
  const State halves = circuit.advanced(circuit.advanced(used, 2.5, 37, 20), 2.5, 63, 20);
  EXPECT_NEAR(whole.charge, halves.charge, 1e-15);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(whole.branch_current_a[k], halves.branch_current_a[k], 1e-14);
    EXPECT_NEAR(whole.charge_lag[k], halves.charge_lag[k], 1e-16);
  }
  EXPECT_EQ(whole.temperature_c, 31);
}

TEST(Circuit, ChargingAppliesTheEfficiency) {
  const Circuit circuit(full_battery());
  const State out = circuit.advanced(Circuit::rested(0.5), 1, 900, 25);
  const State in = circuit.advanced(Circuit::rested(0.5), -1, 900, 25);
  EXPECT_NEAR(0.5 - out.charge, 0.25 / 2.25, 1e-15);
  EXPECT_NEAR(in.charge - 0.5, 0.98 * 0.25 / 2.25, 1e-15);
}

TEST(Circuit, DefaultsReplaceMissingValues) {
  robot::Battery battery;
  battery.nominal_voltage_v = 25.6;
  battery.capacity_ah = 40;
  battery.internal_resistance_ohm = 0.035;
  const Circuit circuit(battery);
  const State full = Circuit::rested(1, -10);
  EXPECT_DOUBLE_EQ(circuit.voltage_v(full, 20), circuit.open_circuit_voltage_v(1) - 0.035 * 20);
  EXPECT_EQ(circuit.advanced(full, 20, 3600, -10).temperature_c, -10);
  EXPECT_GT(circuit.open_circuit_voltage_v(0.5), 25);
  EXPECT_LT(circuit.open_circuit_voltage_v(0.5), 27);
  EXPECT_LT(circuit.cutoff_voltage_v(), 22);
}

}  // namespace
}  // namespace joulecast::battery
