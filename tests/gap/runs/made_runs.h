#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include "gap/runs/run_table.h"
#include "robot/robot_file.h"

// Tables of runs by independent formulas: the thesis's equations of a straight run, integrated by Simpson's
// rule, which is exact for a power of second order in time.
namespace joulecast::gap::testing {

inline robot::RobotModel nomad() {
  return robot::load_robot(std::string(JOULECAST_SOURCE_DIR) + "/deploy/robots/nomad.json").value();
}

// Departures from the robot file.
struct Departure {
  double friction_nm = 0;    // additional, at each wheel
  double rolling = 0;        // coefficient of the payload's weight
  double load_w = 0;         // at the battery, all the time
  double driver_loss = 0;    // of the motors' driving power
  double slope_force_n = 0;  // against the motion
};

// Energy at the battery of a run from rest to rest with constant acceleration [J].
inline double energy_j(const robot::RobotModel& robot, const RunConditions& run, const Departure& d) {
  constexpr double g = 9.80665;
  const double r = robot.kinematics.wheel_radius_m, n = robot.motor.gear_ratio;
  const double mass = robot.mass.chassis_kg + 2 * robot.mass.wheel_kg + run.payload_kg;
  const auto power_w = [&](double v, double a) {
    double driving = 0, braking = 0;
    for (const double friction : robot.motor.friction_torque_nm) {
      const double torque =
          (0.5 * mass * r * r + robot.mass.wheel_inertia_kg_m2 + robot.motor.rotor_inertia_kg_m2) * a / r +
          robot.motor.viscous_friction_nm_s_rad * v / r + friction + d.friction_nm +
          0.5 * r * (d.rolling * run.payload_kg * g + d.slope_force_n);
      const double current = torque / (robot.motor.torque_constant_nm_a * n);
      const double power =
          current * (robot.motor.resistance_ohm * current + robot.motor.voltage_constant_v_s_rad * n * v / r);
      (power > 0 ? driving : braking) += power;
    }
    return robot.idle_power_w + d.load_w + (1 + d.driver_loss) * driving + braking;
  };
  const auto phase_j = [&](double seconds, double from, double to) {
    const double a = (to - from) / seconds;
    return seconds / 6 * (power_w(from, a) + 4 * power_w(0.5 * (from + to), a) + power_w(to, a));
  };
  const double rise_s = run.speed_m_s / run.acceleration_m_s2,
               cruise_s = run.distance_m / run.speed_m_s - rise_s;
  return phase_j(rise_s, 0, run.speed_m_s) + phase_j(cruise_s, run.speed_m_s, run.speed_m_s) +
         phase_j(rise_s, run.speed_m_s, 0) + (robot.idle_power_w + d.load_w) * run.standstill_s;
}

// Conditions of one run, drawn.
inline RunConditions drawn(std::mt19937_64& random) {
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  RunConditions at;
  at.distance_m = between(8, 30);
  at.speed_m_s = between(0.2, 0.9);
  at.acceleration_m_s2 = between(0.15, 0.35);
  at.payload_kg = 2.5 * std::floor(between(0, 4.999));
  at.standstill_s = between(0, 40);
  return at;
}

inline MissionRun made(const robot::RobotModel& robot, const RunConditions& at, const Departure& d,
                       double scatter, std::mt19937_64& random) {
  MissionRun run;
  run.name = std::to_string(random() % 100000);
  run.at = at;
  run.energy_j = energy_j(robot, at, d) * (1 + std::normal_distribution(0.0, scatter)(random));
  return run;
}

}  // namespace joulecast::gap::testing
