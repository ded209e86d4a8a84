#include "tests/study/trial/robot_draw.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "client/virtual_robot/fleet.h"

namespace joulecast::trial {
namespace {

using nlohmann::json;
using virtual_robot::Rng;

// The least dry friction of a wheel over its radius and the robot's weight: every drive has friction, and
// effects are shares of it.
constexpr double least_friction_share = 0.01;
constexpr double gravity_m_s2 = 9.80665;

// Spread evenly in ratio.
double factor(Rng& rng, double most) {
  return std::pow(most, rng.uniform(-1, 1));
}

double rounded(double value) {
  const double scale = std::pow(10, 3 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

void multiply(json& robot, const char* pointer, double by) {
  json& value = robot[json::json_pointer(pointer)];
  if (const double product = value.get<double>() * by; product != 0) value = rounded(product);
}

}  // namespace

DrawnRobot draw_robot(Rng& rng) {
  const auto shipped = virtual_robot::shipped_robots();
  const auto& base = shipped[rng.index(shipped.size())];
  json robot = json::parse(base.json_text);

  const double mass = factor(rng, 1.3);
  const double size = factor(rng, 1.1);
  multiply(robot, "/mass/chassis_kg", mass);
  multiply(robot, "/mass/yaw_inertia_kg_m2", mass * size * size * factor(rng, 1.15));
  multiply(robot, "/mass/wheel_inertia_kg_m2", factor(rng, 1.2));
  multiply(robot, "/kinematics/half_track_m", size);
  multiply(robot, "/kinematics/wheel_radius_m", factor(rng, 1.12));
  robot["kinematics"]["com_offset_m"] = rng.chance(0.5) ? 0.0 : rounded(rng.uniform(0.005, 0.04));

  multiply(robot, "/motor/resistance_ohm", factor(rng, 1.4));
  multiply(robot, "/motor/inductance_h", factor(rng, 1.5));
  const double constant = factor(rng, 1.12);
  multiply(robot, "/motor/torque_constant_nm_a", constant);
  multiply(robot, "/motor/voltage_constant_v_s_rad", constant);
  multiply(robot, "/motor/gear_ratio", factor(rng, 1.1));
  multiply(robot, "/motor/viscous_friction_nm_s_rad", factor(rng, 2));
  const double friction = factor(rng, 1.6);
  const double least_nm = least_friction_share * gravity_m_s2 * robot["mass"]["chassis_kg"].get<double>() *
                          robot["kinematics"]["wheel_radius_m"].get<double>();
  for (json& side : robot["motor"]["friction_torque_nm"]) {
    side = rounded(std::max(side.get<double>(), least_nm) * friction * factor(rng, 1.08));
  }
  multiply(robot, "/battery/internal_resistance_ohm", factor(rng, 1.3));
  multiply(robot, "/idle_power_w", factor(rng, 1.5));
  multiply(robot, "/limits/payload_kg", factor(rng, 1.4));
  multiply(robot, "/limits/speed_m_s", factor(rng, 1.15));
  multiply(robot, "/limits/acceleration_m_s2", factor(rng, 1.2));
  return {std::string(base.kind), robot.dump(2) + "\n"};
}

virtual_robot::RobotParameters as_built(virtual_robot::RobotParameters robot, Rng& rng) {
  const auto off = [&](double deviation) { return 1 + deviation * rng.normal(); };
  const double friction = off(0.010);
  for (double& side : robot.friction_torque_nm) side *= friction * off(0.006);
  robot.viscous_friction_nm_s_rad *= off(0.02);
  robot.resistance_ohm *= off(0.010);
  const double magnet = off(0.002);
  robot.torque_constant_nm_a *= magnet;
  robot.voltage_constant_v_s_rad *= magnet;
  robot.idle_power_w *= off(0.004);
  robot.chassis_kg *= off(0.003);
  robot.yaw_inertia_kg_m2 *= off(0.008);
  robot.wheel_radius_m *= off(0.0008);
  robot.half_track_m *= off(0.0015);
  robot.internal_resistance_ohm *= off(0.05);
  return robot;
}

}  // namespace joulecast::trial
