#pragma once

#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "client/virtual_robot/virtual_robot.h"
#include "signals/sample.h"

namespace joulecast::virtual_robot {

// The effects that are injected without being published, from which trials draw: the last two have a cause
// that the robot can publish.
inline std::span<const EffectEntry> effect_table() {
  return all_effects().first(all_effects().size() - 2);
}

struct Simulation {
  std::vector<signals::MissionEvent> events;
  std::vector<signals::Sample> samples;  // in order of time
  std::vector<signals::CovariateMessage> covariates;
  Truth truth;
};

// All missions of the spec; spec.missions > 0.
inline Simulation simulate_missions(const SimulationSpec& spec, std::uint64_t seed) {
  assert(spec.missions > 0);
  Simulation out;
  VirtualRobot robot(spec, seed);
  while (auto emission = robot.next()) {
    if (auto* event = std::get_if<signals::MissionEvent>(&emission->message)) {
      out.events.push_back(std::move(*event));
    } else if (auto* covariates = std::get_if<signals::CovariateMessage>(&emission->message)) {
      out.covariates.push_back(std::move(*covariates));
    } else {
      out.samples.push_back(std::get<signals::Sample>(emission->message));
    }
  }
  out.truth = {spec.robot.robot_id, seed, effects_of(spec.imperfections), spec.world, robot.finished()};
  return out;
}

// The gap that a set of imperfections makes: integral of |P_measured - P_nominal| over that of |P_measured|,
// battery power, by the robot file's model from the true motion, without noise or scatter between missions.
struct PowerGap {
  double absolute = 0;  // with the imperfections
  double base = 0;      // without: caused by inductance, bristles and the like alone
  double energy = 0;    // (E_measured - E_nominal) / E_measured with the imperfections
  double added() const { return absolute - base; }
};

// Power that the robot file alone expects at the battery for this motion: thesis (2-45) with the full
// cross-coupling, without inductance, all braking power returned, plus idle power.
inline double nominal_power_w(const RobotParameters& robot, const std::array<double, 2>& w,
                              const std::array<double, 2>& a, double payload_kg) {
  const double r = robot.wheel_radius_m;
  const double l = robot.half_track_m;
  const double mass = robot.chassis_kg + 2 * robot.wheel_kg + payload_kg;
  const double inertia = robot.yaw_inertia_kg_m2 + 0.02 * payload_kg;
  const double coupling = robot.chassis_kg * robot.com_offset_m;
  const double v = r * (w[0] + w[1]) / 2;
  const double yaw = r * (w[0] - w[1]) / (2 * l);
  const double force = mass * r * (a[0] + a[1]) / 2 - coupling * yaw * yaw;
  const double moment = inertia * r * (a[0] - a[1]) / (2 * l) + coupling * v * yaw;
  double power = robot.idle_power_w;
  for (std::size_t s : {0u, 1u}) {
    const double side = s == 0 ? 1 : -1;
    // Friction of a resting wheel balances any torque; here it is zero.
    const double dry = robot.friction_torque_nm[s] * std::tanh(w[s] / 0.02);
    const double torque = r / 2 * force + side * r / (2 * l) * moment + robot.wheel_inertia_kg_m2 * a[s] +
                          robot.viscous_friction_nm_s_rad * w[s] + dry;
    const double current = torque / (robot.torque_constant_nm_a * robot.gear_ratio);
    power +=
        current * (robot.resistance_ohm * current + robot.voltage_constant_v_s_rad * robot.gear_ratio * w[s]);
  }
  return power;
}

struct GapIntegrals {
  double absolute = 0;
  double measured = 0;
  double measured_signed = 0;
  double nominal_signed = 0;
};

inline GapIntegrals integrate(const SimulationSpec& spec, std::uint64_t seed) {
  GapIntegrals sums;
  VirtualRobot robot(spec, seed);
  while (auto emission = robot.next()) {
    if (!std::holds_alternative<signals::Sample>(emission->message)) continue;
    const Witness& seen = robot.witness();
    const double measured = seen.reading.battery_voltage_v * seen.reading.battery_current_a;
    const double nominal = nominal_power_w(spec.robot, seen.reading.wheel_speed_rad_s,
                                           seen.wheel_acceleration_rad_s2, seen.reading.declared_payload_kg);
    sums.absolute += std::abs(measured - nominal);
    sums.measured += std::abs(measured);
    sums.measured_signed += measured;
    sums.nominal_signed += nominal;
  }
  return sums;
}

inline SimulationSpec without_chance(SimulationSpec spec) {
  spec.scatter = 0;
  spec.sensors.noise = false;
  spec.sensors.loss_probability = 0;
  return spec;
}

inline double absolute_gap(const SimulationSpec& spec, std::uint64_t seed) {
  const GapIntegrals sums = integrate(spec, seed);
  return sums.absolute / sums.measured;
}

// PowerGap::absolute alone, at half the work.
inline double absolute_power_gap(const SimulationSpec& spec, std::uint64_t seed) {
  return absolute_gap(without_chance(spec), seed);
}

inline PowerGap power_gap(const SimulationSpec& spec, std::uint64_t seed) {
  SimulationSpec clean = without_chance(spec);
  const GapIntegrals with = integrate(clean, seed);
  clean.imperfections = {};
  return {with.absolute / with.measured, absolute_gap(clean, seed),
          (with.measured_signed - with.nominal_signed) / with.measured_signed};
}

}  // namespace joulecast::virtual_robot
