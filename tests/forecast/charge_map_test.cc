#include <gtest/gtest.h>

#include <cmath>

#include "battery/discharge.h"
#include "forecast/outlook.h"
#include "robots.h"

namespace joulecast::forecast {
namespace {

// CVODE follows the circuit at constant power; the map must agree on the charge at the end. The map neglects
// the change of V/U along the way: with r I / U = e at the start its error is at most the relative change of
// U over the way, times e, times the charge drawn.
TEST(ChargeMap, AgreesWithTheCircuit) {
  for (const char* kind : {"amr", "nomad", "p3dx", "tug"}) {
    const robot::RobotModel robot = shipped(kind);
    const battery::Circuit circuit(robot.battery);
    const ChargeMap map(circuit);
    const double power_w = 4 * robot.idle_power_w + 40;
    for (const double from : {0.95, 0.6, 0.4}) {
      const double duration_s =
          0.2 * 3600 * circuit.capacity_ah() * robot.battery.nominal_voltage_v / power_w;
      const auto truth = battery::discharge(circuit, battery::Circuit::rested(from),
                                            {battery::Load::Kind::power, {{duration_s, power_w, power_w}}});
      ASSERT_TRUE(truth);
      ASSERT_EQ(truth->ending, battery::Ending::load_ended);
      const double drawn = from - truth->state.charge;
      const double open = circuit.open_circuit_voltage_v(from),
                   later = circuit.open_circuit_voltage_v(from - drawn);
      const double sag =
          circuit.ohmic_resistance_ohm(battery::Circuit::rested(from)) * power_w / (open * open);
      const double allowed = 2 * sag * std::fabs(open / later - 1) * drawn + 1e-4 * drawn;
      EXPECT_NEAR(map.charge_after(from, truth->energy_j, power_w), truth->state.charge, allowed)
          << kind << from;
      EXPECT_NEAR(map.energy_j(from, truth->state.charge, power_w), truth->energy_j,
                  allowed / drawn * truth->energy_j)
          << kind << from;
    }
  }
}

TEST(ChargeMap, EnergyAndChargeAreInverse) {
  const ChargeMap map{battery::Circuit(shipped("amr").battery)};
  for (const double to : {0.9, 0.5, 0.123, 0.0, -0.05})
    EXPECT_NEAR(map.charge_after(0.93, map.energy_j(0.93, to, 80), 80), to, 1e-9);
}

TEST(ChargeMap, SlopeIsTheDerivative) {
  const ChargeMap map{battery::Circuit(shipped("tug").battery)};
  constexpr double h = 1e-3;
  const double difference = map.energy_j(0.5 + h, 0.5 - h, 0) / (2 * h);
  // Stored energies are joined by straight lines between 201 charges.
  EXPECT_NEAR(map.slope_j(0.5, 0), difference, 5e-3 * difference);
}

TEST(ChargeMap, MorePowerEndsEarlier) {
  const robot::RobotModel robot = shipped("nomad");
  const ChargeMap map{battery::Circuit(robot.battery)};
  EXPECT_LE(map.cutoff_charge(0), map.cutoff_charge(400));
  EXPECT_LT(map.cutoff_charge(400), 1);
}

}  // namespace
}  // namespace joulecast::forecast
