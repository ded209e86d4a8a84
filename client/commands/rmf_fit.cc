#include "client/commands/rmf_fit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string_view>
#include <utility>

#include "base/median.h"
#include "statistics/regression.h"

namespace joulecast::client {
namespace {

constexpr double rmf_gravity_m_s2 = 9.81;  // of SimpleMotionPowerSink
constexpr double rmf_step_s = 0.5;         // of SimpleMotionPowerSink
constexpr double at_rest = 0.02;  // m/s and rad/s: slower than a creeping robot, above the noise of encoders
constexpr double least_positive = 0.001;  // rmf_battery rejects a mass or an inertia of 0
constexpr std::size_t fewest_missions = 6;
constexpr std::size_t held_out_every = 3;

// Means of a mission over steps, which are RMF's unless samples are rarer.
struct Steps {
  double width_s = rmf_step_s;
  std::vector<double> speed_m_s, yaw_rate_rad_s, power_w, current_a;  // NaN without a sample
};

double median_spacing_s(const std::vector<double>& time_s) {
  std::vector<double> spacing;
  for (std::size_t k = 1; k < time_s.size(); ++k) spacing.push_back(time_s[k] - time_s[k - 1]);
  if (spacing.empty()) return rmf_step_s;
  return upper_median(std::move(spacing));
}

Steps steps_of(const RmfTelemetry& t, double wheel_radius_m, double half_track_m) {
  Steps steps;
  if (t.time_s.empty()) return steps;
  steps.width_s = std::max(rmf_step_s, 2 * median_spacing_s(t.time_s));
  const auto count = static_cast<std::size_t>((t.time_s.back() - t.time_s.front()) / steps.width_s) + 1;
  std::vector<double> samples(count, 0);
  for (auto* column : {&steps.speed_m_s, &steps.yaw_rate_rad_s, &steps.power_w, &steps.current_a})
    column->assign(count, 0);
  for (std::size_t k = 0; k < t.time_s.size(); ++k) {
    const auto at = static_cast<std::size_t>((t.time_s[k] - t.time_s.front()) / steps.width_s);
    const double right = wheel_radius_m * t.wheel_rad_s[0][k], left = wheel_radius_m * t.wheel_rad_s[1][k];
    samples[at] += 1;
    steps.speed_m_s[at] += (right + left) / 2;
    steps.yaw_rate_rad_s[at] += (right - left) / (2 * half_track_m);
    steps.power_w[at] += t.voltage_v[k] * t.current_a[k];
    steps.current_a[at] += t.current_a[k];
  }
  for (auto* column : {&steps.speed_m_s, &steps.yaw_rate_rad_s, &steps.power_w, &steps.current_a})
    for (std::size_t k = 0; k < count; ++k) (*column)[k] /= samples[k];  // 0 / 0 is NaN
  return steps;
}

// A drive's energy is linear in: mass, inertia, friction force, ambient power and, if `turns`, the angle.
Eigen::VectorXd terms_of(const RmfDrive& d, bool turns) {
  Eigen::VectorXd terms(turns ? 5 : 4);
  terms.head(4) << d.speeding, d.swerving, d.distance_m, d.duration_s;
  if (turns) terms[4] = d.turn_rad;
  return terms;
}

using RmfMissions = std::vector<std::vector<RmfDrive>>;

Eigen::VectorXd coefficients_of(const RmfMissions& missions, bool turns) {
  const Eigen::Index p = turns ? 5 : 4;
  Eigen::MatrixXd xx = Eigen::MatrixXd::Zero(p, p);
  Eigen::VectorXd xy = Eigen::VectorXd::Zero(p);
  for (const auto& mission : missions)
    for (const RmfDrive& drive : mission) {
      const Eigen::VectorXd terms = terms_of(drive, turns);
      xx += terms * terms.transpose() / drive.duration_s;
      xy += terms * (drive.energy_j / drive.duration_s);
    }
  return statistics::signed_solution(xx, xy, std::vector<bool>(static_cast<std::size_t>(p), true));
}

RmfError error_by(std::span<const std::vector<RmfDrive>> missions,
                  const std::function<double(const RmfDrive&)>& energy_j) {
  RmfError error;
  for (const auto& mission : missions) {
    double measured = 0, modelled = 0;
    for (const RmfDrive& drive : mission) measured += drive.energy_j, modelled += energy_j(drive);
    const double relative = modelled / measured - 1;
    error.absolute += std::fabs(relative) / static_cast<double>(missions.size());
    error.bias += relative / static_cast<double>(missions.size());
  }
  return error;
}

// "  mass: 55.0  # kg": the key, and the place of the value; none for "mechanical_system:".
struct YamlLine {
  std::string_view key;
  std::size_t value_begin = 0, value_end = 0;
};

std::optional<YamlLine> read_line(std::string_view line) {
  constexpr std::string_view space = " \t\r";
  const auto first = line.find_first_not_of(space), colon = line.find(':');
  if (colon == std::string_view::npos || first >= colon || line[first] == '#') return std::nullopt;
  const auto begin = line.find_first_not_of(space, colon + 1);
  const std::string_view key = line.substr(first, colon - first);
  if (begin == std::string_view::npos || line[begin] == '#') return YamlLine{key};
  return YamlLine{key, begin, std::min(line.find_first_of(" \t\r#", begin), line.size())};
}

// The YAML with each value on a line of its own below its section replaced by `value(place, text)`.
std::string with_values(const std::string& yaml,
                        const std::function<std::string(const RmfPlace&, const std::string&)>& value) {
  std::string section, out;
  std::istringstream lines(yaml);
  for (std::string line; std::getline(lines, line); out += line + '\n') {
    const std::optional<YamlLine> read = read_line(line);
    if (!read) continue;
    if (read->value_end == 0) {
      section = read->key;
      continue;
    }
    const auto place = std::ranges::find_if(
        rmf_places(), [&](const RmfPlace& p) { return section == p.section && read->key == p.key; });
    if (place == rmf_places().end()) continue;
    const std::size_t size = read->value_end - read->value_begin;
    line.replace(read->value_begin, size, value(*place, line.substr(read->value_begin, size)));
  }
  return out;
}

// The energy of a drive in joules by RMF's model.
double rmf_energy_j(const RmfParameters& p, const RmfDrive& d) {
  return p.mass * d.speeding + p.moment_of_inertia * d.swerving +
         p.friction_coefficient * p.mass * rmf_gravity_m_s2 * d.distance_m + p.ambient_power * d.duration_s;
}

RmfError rmf_error(const RmfParameters& parameters, std::span<const std::vector<RmfDrive>> missions) {
  return error_by(missions, [&](const RmfDrive& drive) { return rmf_energy_j(parameters, drive); });
}

}  // namespace

const std::vector<RmfPlace>& rmf_places() {
  using P = RmfParameters;
  static const std::vector<RmfPlace> table{
      {"battery_system", "voltage", "V", &P::voltage},
      {"battery_system", "capacity", "Ah", &P::capacity},
      {"battery_system", "charging_current", "A", &P::charging_current},
      {"mechanical_system", "mass", "kg", &P::mass},
      {"mechanical_system", "moment_of_inertia", "kg m^2", &P::moment_of_inertia},
      {"mechanical_system", "friction_coefficient", "", &P::friction_coefficient},
      {"ambient_system", "power", "W", &P::ambient_power},
      {"tool_system", "power", "W", &P::tool_power}};
  return table;
}

std::vector<RmfDrive> rmf_drives(const RmfTelemetry& telemetry, double wheel_radius_m, double half_track_m) {
  const Steps s = steps_of(telemetry, wheel_radius_m, half_track_m);
  std::vector<RmfDrive> drives;
  bool rested = true, moved = false, complete = false;
  const auto half_change = [](double from, double to) { return std::fabs(to * to - from * from) / 2; };
  for (std::size_t k = 0; k < s.speed_m_s.size(); ++k) {
    const bool rests = std::fabs(s.speed_m_s[k]) < at_rest && std::fabs(s.yaw_rate_rad_s[k]) < at_rest;
    if (drives.empty() || (moved && rested && !rests)) {
      if (!drives.empty() && !complete) drives.pop_back();
      drives.emplace_back();
      complete = true;
      moved = false;
    }
    rested = rests;
    moved = moved || !rests;
    RmfDrive& drive = drives.back();
    complete = complete && std::isfinite(s.power_w[k]) && std::isfinite(s.speed_m_s[k]);
    drive.energy_j += s.power_w[k] * s.width_s;
    drive.charge_c += s.current_a[k] * s.width_s;
    drive.duration_s += s.width_s;
    drive.distance_m += std::fabs(s.speed_m_s[k]) * s.width_s;
    drive.turn_rad += std::fabs(s.yaw_rate_rad_s[k]) * s.width_s;
    if (k == 0) continue;
    drive.speeding += half_change(s.speed_m_s[k - 1], s.speed_m_s[k]);
    drive.swerving += half_change(s.yaw_rate_rad_s[k - 1], s.yaw_rate_rad_s[k]);
  }
  if (!drives.empty() && !complete) drives.pop_back();
  return drives;
}

Result<RmfFit> fit_rmf(const std::vector<std::vector<RmfDrive>>& missions, double capacity_ah,
                       const std::optional<RmfParameters>& before) {
  RmfMissions fitted, held_out;
  for (const auto& mission : missions) {
    if (mission.empty()) continue;
    const bool kept = (fitted.size() + held_out.size()) % held_out_every == held_out_every - 1;
    (kept ? held_out : fitted).push_back(mission);
  }
  if (fitted.size() + held_out.size() < fewest_missions)
    return fail(
        Fault::infeasible, "",
        fmt::format(
            "{} of the robot's missions have telemetry with a measured battery, at least {} are needed",
            fitted.size() + held_out.size(), fewest_missions));
  const Eigen::VectorXd c = coefficients_of(fitted, false), with_turns = coefficients_of(fitted, true);
  double energy_j = 0, charge_c = 0;
  for (const auto& mission : fitted)
    for (const RmfDrive& drive : mission) energy_j += drive.energy_j, charge_c += drive.charge_c;
  RmfFit fit;
  RmfParameters& p = fit.parameters;
  p.voltage = energy_j / charge_c;
  p.capacity = capacity_ah;
  p.mass = std::max(c[0], least_positive);
  p.moment_of_inertia = std::max(c[1], least_positive);
  p.friction_coefficient = c[2] / (p.mass * rmf_gravity_m_s2);
  p.ambient_power = c[3];
  fit.fitted = fitted.size();
  fit.held_out = held_out.size();
  fit.error = rmf_error(p, held_out);
  fit.error_with_turns =
      error_by(held_out, [&](const RmfDrive& drive) { return with_turns.dot(terms_of(drive, true)); });
  fit.turn_j_per_rad = with_turns[4];
  if (before) {
    fit.error_before = rmf_error(*before, held_out);
    p.charging_current = before->charging_current;
    p.tool_power = before->tool_power;
  }
  return fit;
}

Result<RmfParameters> read_rmf_configuration(const std::string& yaml) {
  RmfParameters parameters;
  std::vector<const RmfPlace*> missing;
  for (const RmfPlace& place : rmf_places()) missing.push_back(&place);
  std::string wrong;
  with_values(yaml, [&](const RmfPlace& place, const std::string& text) {
    char* end = nullptr;
    parameters.*place.value = std::strtod(text.c_str(), &end);
    if (*end != '\0') wrong = text;
    std::erase(missing, &place);
    return text;
  });
  if (!wrong.empty()) return fail(Fault::invalid, "--config", wrong + " is not a number");
  if (!missing.empty())
    return fail(Fault::invalid, "--config",
                fmt::format("has no number {} on a line of its own below {}", missing.front()->key,
                            missing.front()->section));
  return parameters;
}

std::string with_rmf_parameters(const std::string& yaml, const RmfParameters& parameters) {
  return with_values(yaml, [&](const RmfPlace& place, const std::string& text) {
    const double value = parameters.*place.value;
    return std::isnan(value) ? text : fmt::format("{:.4g}", value);
  });
}

}  // namespace joulecast::client
