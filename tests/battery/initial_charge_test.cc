#include "battery/initial_charge.h"

#include <gtest/gtest.h>

#include "tests/support/sample_robots.h"

namespace joulecast::battery {
namespace {

TEST(InitialCharge, InvertsTheRestingCircuit) {
  const Circuit circuit(joulecast::testing::nomad().battery);
  for (double charge : {0.1, 0.35, 0.6, 0.95}) {
    for (double current : {-3.0, 0.0, 2.0}) {
      const double volts = circuit.voltage_v(Circuit::rested(charge), current);
      EXPECT_NEAR(charge_at_rest(circuit, volts, current), charge, 1e-9);
    }
  }
}

TEST(InitialCharge, StopsAtEmptyAndFull) {
  const Circuit circuit(joulecast::testing::nomad().battery);
  EXPECT_NEAR(charge_at_rest(circuit, 1, 0), 0, 1e-9);
  EXPECT_NEAR(charge_at_rest(circuit, 100, 0), 1, 1e-9);
}

}  // namespace
}  // namespace joulecast::battery
