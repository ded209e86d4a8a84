#include "client/virtual_robot/simulate.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

namespace joulecast::virtual_robot {
namespace {

constexpr double gap_tolerance = 2e-3;  // of the requested gap
constexpr double largest_growth = 6;    // of the strength in one step of the search

struct GapIntegrals {
  double absolute = 0;
  double measured = 0;
  double measured_signed = 0;
  double nominal_signed = 0;
};

GapIntegrals integrate(const SimulationSpec& spec, std::uint64_t seed) {
  GapIntegrals sums;
  VirtualRobot robot(spec, seed);
  Emission emission;
  while (robot.next(emission)) {
    if (!std::holds_alternative<signals::Sample>(emission.message)) continue;
    const Witness& seen = robot.witness();
    const double measured = seen.reading.battery_voltage_v * seen.reading.battery_current_a;
    const double nominal = nominal_power_w(spec.robot, seen.reading.wheel_speed_rad_s,
                                           seen.wheel_acceleration_rad_s2, seen.payload_kg);
    sums.absolute += std::abs(measured - nominal);
    sums.measured += std::abs(measured);
    sums.measured_signed += measured;
    sums.nominal_signed += nominal;
  }
  return sums;
}

SimulationSpec without_chance(SimulationSpec spec) {
  spec.scatter = 0;
  spec.sensors.noise = false;
  spec.sensors.loss_probability = 0;
  return spec;
}

double absolute_gap(const SimulationSpec& spec, std::uint64_t seed) {
  const GapIntegrals sums = integrate(spec, seed);
  return sums.absolute / sums.measured;
}

}  // namespace

Simulation simulate_missions(const SimulationSpec& spec, std::uint64_t seed) {
  assert(spec.missions > 0);
  Simulation out;
  VirtualRobot robot(spec, seed);
  Emission emission;
  while (robot.next(emission)) {
    if (auto* event = std::get_if<signals::MissionEvent>(&emission.message)) {
      out.events.push_back(std::move(*event));
    } else if (auto* covariates = std::get_if<signals::CovariateMessage>(&emission.message)) {
      out.covariates.push_back(std::move(*covariates));
    } else {
      out.samples.push_back(std::get<signals::Sample>(emission.message));
    }
  }
  out.truth = {spec.robot.robot_id, seed, effects_of(spec.imperfections), spec.world, robot.finished()};
  return out;
}

double nominal_power_w(const RobotParameters& robot, const std::array<double, 2>& w,
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

double absolute_power_gap(const SimulationSpec& spec, std::uint64_t seed) {
  return absolute_gap(without_chance(spec), seed);
}

PowerGap power_gap(const SimulationSpec& spec, std::uint64_t seed) {
  SimulationSpec clean = without_chance(spec);
  const GapIntegrals with = integrate(clean, seed);
  clean.imperfections = {};
  return {with.absolute / with.measured, absolute_gap(clean, seed),
          (with.measured_signed - with.nominal_signed) / with.measured_signed};
}

Result<double> strength_for_gap(const SimulationSpec& spec, std::uint64_t seed, std::string_view effect_id,
                                double added_gap, double sign) {
  const auto entries = all_effects();
  const auto entry =
      std::find_if(entries.begin(), entries.end(), [&](const auto& e) { return e.id == effect_id; });
  if (entry == entries.end()) return invalid("effect", "no effect is called " + std::string(effect_id));
  if (!(added_gap > 0)) return invalid("added_gap", "must be above 0");

  SimulationSpec clean = without_chance(spec);
  const auto gap_at = [&](double strength) {
    clean.imperfections.*(entry->strength) = strength;
    return absolute_gap(clean, seed);
  };
  const double base = gap_at(0);
  const auto shortfall = [&](double strength) { return gap_at(sign * strength) - base - added_gap; };

  // The gap grows nearly in proportion, so step by proportion and a little over, from below: a far too large
  // strength may stall the robot, and the gap is then meaningless.
  double low = 0;
  double low_value = -added_gap;
  double high = entry->search_limit / 1024;
  double high_value = shortfall(high);
  while (high_value < 0) {
    if (high >= entry->search_limit) {
      std::ostringstream message;
      message << effect_id << " adds at most " << high_value + added_gap << " with " << sign * high << " "
              << entry->unit;
      return fail(Fault::infeasible, "added_gap", message.str());
    }
    const double reached = high_value + added_gap;
    const double growth =
        reached > 0 ? std::clamp(1.2 * added_gap / reached, 1.5, largest_growth) : largest_growth;
    low = high;
    low_value = high_value;
    high = std::min(growth * high, entry->search_limit);
    high_value = shortfall(high);
  }

  // False position; the Illinois rule halves the value of an end that stays, so that both ends close in.
  int stayed = 0;
  for (int k = 0; k < 30; ++k) {
    const double middle = low + (high - low) * low_value / (low_value - high_value);
    const double value = shortfall(middle);
    if (std::abs(value) <= gap_tolerance * added_gap || high - low <= 1e-6 * high) return sign * middle;
    if (value < 0) {
      low = middle;
      low_value = value;
      if (stayed < 0) high_value *= 0.5;
      stayed = -1;
    } else {
      high = middle;
      high_value = value;
      if (stayed > 0) low_value *= 0.5;
      stayed = 1;
    }
  }
  return sign * 0.5 * (low + high);
}

std::string truth_json(const std::vector<Truth>& truths) {
  using Json = nlohmann::json;
  Json robots = Json::array();
  for (const Truth& truth : truths) {
    Json effects = Json::object();
    for (const auto& [id, strength] : truth.effects) effects[id] = strength;
    Json missions = Json::array();
    for (const MissionTruth& m : truth.missions) {
      const PlantAccounts& a = m.accounts;
      missions.push_back({{"mission_id", m.mission_id},
                          {"payload_kg", m.payload_kg},
                          {"undeclared_kg", m.undeclared_kg},
                          {"duration_s", m.duration_s},
                          {"distance_m", m.distance_m},
                          {"battery_energy_j", m.battery_energy_j},
                          {"motor_energy_j", a.motor},
                          {"driver_energy_j", a.bus},
                          {"copper_j", a.copper},
                          {"brush_j", a.brush},
                          {"internal_friction_j", a.internal},
                          {"floor_friction_j", a.floor},
                          {"gear_j", a.gear},
                          {"drag_j", a.drag},
                          {"scrub_j", a.scrub},
                          {"slip_j", a.slip},
                          {"potential_j", a.potential}});
    }
    const World& w = truth.world;
    robots.push_back({{"robot_id", truth.robot_id},
                      {"seed", truth.seed},
                      {"effects", effects},
                      {"world",
                       {{"zone", {w.zone_x_m, w.zone_y_m, w.zone_radius_m}},
                        {"slope_direction_rad", w.slope_direction_rad},
                        {"weak_side", w.weak_side},
                        {"stribeck_speed_m_s", w.stribeck_speed_m_s},
                        {"stribeck_power", w.stribeck_power},
                        {"bristle_rad", w.bristle_rad},
                        {"brush_softness", w.brush_softness},
                        {"motor_sensor_share", w.motor_sensor_share},
                        {"battery_sensor_share", w.battery_sensor_share},
                        {"emf_loss_share", w.emf_loss_share},
                        {"thermal_time_constant_s", w.thermal_time_constant_s},
                        {"period_s", w.period_s},
                        {"burst_time_s", w.burst_time_s},
                        {"patch_m", w.patch_m}}},
                      {"missions", missions}});
  }
  return Json{{"robots", robots}}.dump(2) + "\n";
}

}  // namespace joulecast::virtual_robot
