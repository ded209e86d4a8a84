#include "client/virtual_robot/plant.h"

#include <array>
#include <cmath>
#include <string>

#include "tests/client/robots.h"

namespace joulecast::virtual_robot {
namespace {

double spent(const PlantAccounts& a) {
  return a.copper + a.brush + a.conversion + a.internal + a.floor + a.gear + a.drag + a.scrub + a.slip +
         a.potential;
}

// Voltages that start, turn, brake through zero and reverse.
std::array<double, 2> stirring(const RobotParameters& robot, double time_s) {
  const double v = 0.4 * robot.nominal_voltage_v;
  return {v * std::sin(1.1 * time_s), v * std::sin(0.9 * time_s + 0.2)};
}

void drive(Plant& plant, const RobotParameters& robot, double duration_s, double step_s) {
  const auto steps = static_cast<int>(std::lround(duration_s / step_s));
  // Voltage changes every 5 ms for any step, so that runs with different steps solve the same problem.
  const auto hold = static_cast<int>(std::lround(0.005 / step_s));
  std::array<double, 2> voltage{};
  for (int k = 0; k < steps; ++k) {
    if (k % hold == 0) voltage = stirring(robot, step_s * k);
    plant.advance(voltage, step_s);
  }
}

class PlantOfKind : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Kinds, PlantOfKind, ::testing::Values("amr", "nomad", "tug", "p3dx"),
                         [](const auto& kind) { return std::string(kind.param); });

TEST_P(PlantOfKind, SettlesAtSteadyState) {
  // With w' = i' = 0, d = 0: K_t n i = T_m + nu w and V = R i + K_w n w, per wheel.
  RobotParameters robot = shipped(GetParam());
  robot.com_offset_m = 0;
  Plant plant(robot, {}, {});
  const double voltage = 0.5 * robot.nominal_voltage_v;
  for (int k = 0; k < 40'000; ++k) plant.advance({voltage, voltage}, 5e-4);
  const double kt = robot.torque_constant_nm_a * robot.gear_ratio;
  const double kw = robot.voltage_constant_v_s_rad * robot.gear_ratio;
  for (std::size_t s : {0u, 1u}) {
    const double dry = robot.friction_torque_nm[s];
    const double nu = robot.viscous_friction_nm_s_rad;
    const double speed = (voltage - robot.resistance_ohm * dry / kt) / (robot.resistance_ohm * nu / kt + kw);
    EXPECT_NEAR(plant.state().wheel_speed_rad_s[s] / speed, 1, 1e-9);
    EXPECT_NEAR(plant.state().current_a[s] / ((dry + nu * speed) / kt), 1, 1e-9);
  }
}

TEST_P(PlantOfKind, ConservesEnergy) {
  const RobotParameters robot = shipped(GetParam());
  Imperfections every;
  every.coulomb_friction = 0.3;
  every.viscous_friction = 1;
  every.stribeck_friction = 0.5;
  every.load_rolling_resistance = 0.02;
  every.floor_resistance_zone = 0.02;
  every.slope = 0.01;
  every.aerodynamic_drag = 5;
  every.turning_scrub = 0.05;
  every.gear_efficiency = 0.1;
  every.com_offset = 0.1;
  every.linear_inertia_error = 0.2;
  every.brush_drop = 0.2;
  every.torque_constant_loss = 0.1;
  every.wheel_radius_asymmetry = 0.05;
  every.wheel_slip = 0.03;
  every.x_cogging = 0.3;
  every.x_speed_cubed = 0.5;
  every.x_cold_grease = 0.5;
  every.x_oval_wheel = 0.3;
  every.x_floor_patches = 0.01;
  every.x_payload_speed = 0.02;
  World world;
  world.emf_loss_share = 0.5;
  Plant plant(robot, every, world);
  plant.begin_mission(0.5 * robot.payload_limit_kg, 0, {});
  drive(plant, robot, 20, 1.25e-4);
  const PlantAccounts& a = plant.accounts();
  // Runge-Kutta loses orders for one step at each change of sign, about thirty times in this run. A millionth
  // of the work is a hundred times the largest error of one such step.
  EXPECT_NEAR((a.motor - spent(a) - plant.stored_energy_j()) / a.motor, 0, 1e-6);
  for (const double loss : {a.copper, a.brush, a.internal, a.floor, a.gear, a.drag, a.scrub, a.slip}) {
    EXPECT_GT(loss, 0);
  }
}

TEST_P(PlantOfKind, ConvergesWithFourthOrder) {
  RobotParameters robot = shipped(GetParam());
  const double voltage = 0.6 * robot.nominal_voltage_v;
  // Turning and accelerating, away from the speeds at which friction changes its sign.
  const auto end = [&](double step_s) {
    Plant plant(robot, {}, {});
    const double w = 2;
    plant.state().wheel_speed_rad_s = {w, w};
    plant.state().bend = {1, 1};
    const auto steps = static_cast<int>(std::lround(0.4 / step_s));
    for (int k = 0; k < steps; ++k) plant.advance({voltage, 0.8 * voltage}, step_s);
    return plant;
  };
  const Plant fine = end(5e-5);
  const auto error = [&](double step_s) {
    const Plant coarse = end(step_s);
    return std::hypot(coarse.state().current_a[0] - fine.state().current_a[0],
                      coarse.state().wheel_speed_rad_s[0] - fine.state().wheel_speed_rad_s[0],
                      coarse.state().x_m - fine.state().x_m);
  };
  // 2^4 when halved; between 2^3.4 and 2^4.8 leaves room for the next term of the expansion.
  const double ratio = error(8e-4) / error(4e-4);
  EXPECT_GT(ratio, std::pow(2, 3.4));
  EXPECT_LT(ratio, std::pow(2, 4.8));
}

TEST(Plant, OffsetForcesDoNoWork) {
  // Without friction and with open circuits (very large R) the kinetic energy of a turning robot is constant.
  RobotParameters robot = shipped("amr");
  robot.friction_torque_nm = {0, 0};
  robot.viscous_friction_nm_s_rad = 0;
  robot.com_offset_m = 0.15;
  robot.resistance_ohm = 1e9;
  robot.inductance_h = 1e9;
  Plant plant(robot, {}, {});
  plant.state().wheel_speed_rad_s = {6, 2};
  const double before_j = plant.stored_energy_j();
  const double yaw_before = plant.yaw_rate_rad_s();
  for (int k = 0; k < 4000; ++k) plant.advance({0, 0}, 5e-4);
  EXPECT_NEAR(plant.stored_energy_j() / before_j, 1, 1e-7);
  // The offset has an effect: it converts rotation into forward speed.
  EXPECT_GT(std::abs(plant.yaw_rate_rad_s() - yaw_before), 0.1);
}

TEST(Plant, FrictionHoldsRobotOnSlope) {
  const RobotParameters robot = shipped("nomad");
  Imperfections tilt;
  tilt.slope = 0.02;
  Plant plant(robot, tilt, {});
  for (int k = 0; k < 20'000; ++k) plant.advance({0, 0}, 5e-4);
  // The bristles bend under m g sin(a) r / 2 per wheel, T = level * bend, and then nothing moves.
  const double load_nm =
      (robot.chassis_kg + 2 * robot.wheel_kg) * 9.80665 * std::sin(0.02) * robot.wheel_radius_m / 2;
  EXPECT_NEAR(plant.state().bend[0] * robot.friction_torque_nm[0], -load_nm, 1e-6);
  EXPECT_NEAR(plant.speed_m_s(), 0, 1e-9);
  // It stays at rest; plain tanh friction would creep.
  const double x_m = plant.state().x_m;
  for (int k = 0; k < 20'000; ++k) plant.advance({0, 0}, 5e-4);
  EXPECT_NEAR(plant.state().x_m, x_m, 1e-9);
}

}  // namespace
}  // namespace joulecast::virtual_robot
