#include "tests/study/trial/foreign/foreign_case.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "base/text_file.h"
#include "client/files.h"
#include "telemetry/event_log.h"
#include "telemetry/recording.h"

namespace joulecast::trial::foreign {
namespace {

using nlohmann::json;
using virtual_robot::Rng;

constexpr double least_gap = 0.03, most_gap = 0.15;
constexpr double downward_share = 0.2;

// Differences that a calibration leaves.
ForeignRobot built_like(ForeignRobot r, Rng& rng) {
  const auto off = [&](double& value, double share) { value *= 1 + share * rng.normal(); };
  off(r.friction_nm[0], 0.01);
  off(r.friction_nm[1], 0.01);
  off(r.viscous_nm_s_rad, 0.02);
  off(r.resistance_ohm, 0.01);
  off(r.constant_nm_a, 0.003);
  off(r.chassis_kg, 0.005);
  off(r.idle_w, 0.01);
  return r;
}

// Mean absolute difference of battery power as read, relative to the power without.
double gap_of(const ForeignCase& c, const Departures& with) {
  double difference_w = 0, total_w = 0;
  for (std::size_t m = 0; m < std::min<std::size_t>(2, c.drives.size()); ++m) {
    const auto plain = driven(c.built, {}, c.drives[m], 0.02, 5e-4);
    const auto changed = driven(c.built, with, c.drives[m], 0.02, 5e-4);
    for (std::size_t k = 0; k < plain.size(); ++k) {
      const double read_w = changed[k].battery_power_w * (1 + with.current_gain);
      difference_w += std::fabs(read_w - plain[k].battery_power_w);
      total_w += std::fabs(plain[k].battery_power_w);
    }
  }
  return difference_w / total_w;
}

// The strength at which an effect alone has this gap; none where it exceeds its most.
std::optional<double> strength_for(const ForeignCase& c, const DepartureEntry& entry, double sign,
                                   double gap) {
  double strength = entry.most / 8;
  for (int k = 0; k < 6; ++k) {
    Departures alone;
    alone.*entry.strength = sign * strength;
    const double reached = gap_of(c, alone);
    if (std::fabs(reached - gap) < 0.05 * gap) return sign * strength;
    strength *= reached > 0 ? std::clamp(gap / reached, 0.1, 10.0) : 4;
    if (strength > (sign < 0 ? 0.5 : entry.most)) return std::nullopt;
  }
  return std::nullopt;
}

void plant_departures(ForeignCase& c, std::uint64_t seed, Rng& rng) {
  if (c.kind == Kind::none) return;
  std::vector<const DepartureEntry*> from;
  for (const DepartureEntry& entry : departures()) {
    if (entry.id.starts_with("x_") == (c.kind == Kind::outside)) from.push_back(&entry);
  }
  const std::size_t wanted = c.kind == Kind::pair ? 2 : 1;
  for (std::size_t tries = 0; tries < 40 && c.effects.size() < wanted; ++tries) {
    const std::size_t number = turn_in_kind(c.index) * wanted + c.effects.size();
    const DepartureEntry& entry =
        *from[tries == 0 ? in_turn(seed, c.kind == Kind::outside ? 3 : wanted, from.size(), number)
                         : rng.index(from.size())];
    const double sign = rng.chance(downward_share) && entry.downward ? -1 : 1;
    const double gap = least_gap * std::pow(most_gap / least_gap, rng.uniform());
    if (c.with.*entry.strength != 0) continue;
    const auto strength = strength_for(c, entry, sign, gap);
    if (!strength) continue;
    c.with.*entry.strength = *strength;
    c.effects.emplace_back(entry.id, *strength);
  }
  c.gap = gap_of(c, c.with);
}

json robot_json(const ForeignRobot& r) {
  return {
      {"robot_id", "foreign"},
      {"kinematics", {{"wheel_radius_m", r.radius_m}, {"half_track_m", r.half_track_m}, {"com_offset_m", 0}}},
      {"mass",
       {{"chassis_kg", r.chassis_kg},
        {"wheel_kg", r.wheel_kg},
        {"yaw_inertia_kg_m2", r.yaw_inertia_kg_m2},
        {"wheel_inertia_kg_m2", r.wheel_inertia_kg_m2}}},
      {"motor",
       {{"resistance_ohm", r.resistance_ohm},
        {"inductance_h", r.inductance_h},
        {"torque_constant_nm_a", r.constant_nm_a},
        {"voltage_constant_v_s_rad", r.constant_nm_a},
        {"gear_ratio", 1},
        {"rotor_inertia_kg_m2", 0},
        {"viscous_friction_nm_s_rad", r.viscous_nm_s_rad},
        {"friction_torque_nm", r.friction_nm}}},
      {"battery",
       {{"nominal_voltage_v", r.battery_v},
        {"capacity_ah", 40},
        {"internal_resistance_ohm", r.battery_ohm},
        {"reserve_fraction", 0.1}}},
      {"idle_power_w", r.idle_w},
      {"limits",
       {{"speed_m_s", r.speed_m_s},
        {"acceleration_m_s2", r.acceleration_m_s2},
        {"yaw_rate_rad_s", r.yaw_rate_rad_s},
        {"current_a", r.current_a},
        {"payload_kg", r.payload_kg}}}};
}

// A mission's readings: instantaneous, with white noise.
telemetry::Recording recorded(const ForeignCase& c, std::size_t mission, bool motor_channels) {
  Rng rng = Rng::stream(c.noise_seed, mission);
  ForeignRobot today = c.built;  // differs a little from mission to mission
  for (double& torque : today.friction_nm) torque *= 1 + 0.01 * rng.normal();
  today.idle_w *= 1 + 0.005 * rng.normal();
  telemetry::Recording out;
  out.robot_id = "foreign";
  out.mission_id = std::string("m").append(std::to_string(mission));
  out.payload_kg = c.drives[mission].payload_kg;
  const auto start_us = 1'750'000'000'000'000 + static_cast<std::int64_t>(mission) * 600'000'000;
  const double gain = 1 + c.with.current_gain;
  for (const ForeignState& s : driven(today, c.with, c.drives[mission], c.sample_period_s)) {
    signals::Sample sample;
    sample.utime_us = start_us + std::llround(s.time_s * 1e6);
    sample.sequence = static_cast<std::int64_t>(out.samples.size());
    for (std::size_t k : {0u, 1u}) {
      sample.wheel_velocity_rad_s[k] = s.wheel_rad_s[k] + 0.01 * rng.normal();
      const double voltage_v = s.voltage_v[k] + 0.02 * rng.normal();
      const double current_a = s.current_a[k] * gain + 0.03 * rng.normal();
      if (!motor_channels) continue;
      sample.motor_voltage_v[k] = voltage_v;
      sample.motor_current_a[k] = current_a;
    }
    sample.battery_voltage_v = s.battery_voltage_v + 0.01 * rng.normal();
    sample.battery_current_a = s.battery_current_a * gain + 0.02 * rng.normal();
    sample.yaw_rate_rad_s = s.yaw_rate_rad_s + 0.004 * rng.normal();
    sample.pose = {s.x_m + 0.005 * rng.normal(), s.y_m + 0.005 * rng.normal(),
                   s.heading_rad + 0.003 * rng.normal()};
    sample.payload_kg = out.payload_kg;
    out.samples.push_back(sample);
  }
  return out;
}

Result<void> write_log(const ForeignCase& c, bool motor_channels, const std::filesystem::path& path) {
  auto log = telemetry::EventLogWriter::create(path.string());
  if (!log) return tl::unexpected(std::move(log.error()));
  for (std::size_t m = 0; m < c.drives.size(); ++m) {
    if (auto done = telemetry::write_recording(*log, recorded(c, m, motor_channels)); !done) return done;
  }
  return log->close();
}

}  // namespace

ForeignRobot draw_robot_file(Rng& rng) {
  ForeignRobot r;
  const bool large = rng.chance(0.5);
  r.radius_m = rng.uniform(0.08, 0.16);
  r.half_track_m = rng.uniform(0.2, 0.35);
  r.chassis_kg = large ? rng.uniform(90, 200) : rng.uniform(25, 70);
  r.wheel_kg = rng.uniform(1, 4);
  r.wheel_inertia_kg_m2 = 0.5 * r.wheel_kg * r.radius_m * r.radius_m + rng.uniform(0.005, 0.02);
  r.yaw_inertia_kg_m2 = r.chassis_kg * r.half_track_m * r.half_track_m * rng.uniform(0.8, 1.4);
  r.battery_v = large ? 48 : 24;
  r.battery_ohm = rng.uniform(0.01, 0.04);
  r.speed_m_s = rng.uniform(0.9, 1.6);
  r.acceleration_m_s2 = rng.uniform(0.4, 0.8);
  r.yaw_rate_rad_s = rng.uniform(0.8, 1.5);
  r.payload_kg = rng.uniform(0.3, 0.8) * r.chassis_kg;
  // At full speed the motor turns against 60 % of the battery's voltage.
  r.constant_nm_a = 0.6 * r.battery_v * r.radius_m / r.speed_m_s;
  r.resistance_ohm = rng.uniform(0.2, 0.5) * (large ? 1.5 : 1);
  r.inductance_h = r.resistance_ohm * rng.uniform(0.8e-3, 1.5e-3);
  const double weight_n = 9.81 * (r.chassis_kg + 2 * r.wheel_kg);
  for (double& torque : r.friction_nm) torque = rng.uniform(0.02, 0.035) * weight_n * r.radius_m / 2;
  r.viscous_nm_s_rad = rng.uniform(0.1, 0.3) * r.friction_nm[0] * r.radius_m / r.speed_m_s;
  r.idle_w = rng.uniform(10, 35);
  r.current_a = 40;
  return r;
}

std::string robot_json_text(const ForeignRobot& robot) {
  return robot_json(robot).dump(2) + "\n";
}

ForeignCase draw_foreign_case(std::uint64_t seed, std::size_t index) {
  Rng rng = Rng::stream(seed, 500'000'000 + index);
  ForeignCase c;
  c.index = index;
  c.kind = kind_in_turn(index);
  c.noise_seed = rng.next();
  c.file = draw_robot_file(rng);
  c.built = built_like(c.file, rng);
  constexpr std::array periods_s{0.02, 0.05, 0.1};
  c.sample_period_s = periods_s[rng.index(periods_s.size())];
  const std::size_t missions = 4 + rng.index(4);
  for (std::size_t m = 0; m < missions; ++m) c.drives.push_back(draw_drive(c.file, rng.uniform(50, 90), rng));
  plant_departures(c, seed, rng);
  if (c.effects.empty()) c.kind = Kind::none;
  if (c.effects.size() == 1 && c.kind == Kind::pair) c.kind = Kind::single;
  return c;
}

Result<std::uint64_t> write_foreign_case(const ForeignCase& c, bool motor_channels, const CaseFiles& files) {
  std::error_code failed;
  std::filesystem::create_directories(files.folder, failed);
  if (failed) return fail(Fault::unavailable, files.folder.string(), "cannot be made: " + failed.message());
  json effects = json::array();
  for (const auto& [id, strength] : c.effects) effects.push_back({{"id", id}, {"strength", strength}});
  const json truth{{"case", c.index}, {"kind", name_of(c.kind)}, {"gap", c.gap}, {"effects", effects}};
  for (const auto& [path, document] :
       {std::pair{files.robot(), robot_json(c.file)}, std::pair{files.truth(), truth}}) {
    if (auto done = write_text_file(path.string(), document.dump(2) + "\n", Existing::replace); !done)
      return tl::unexpected(std::move(done.error()));
  }
  if (auto done = write_log(c, motor_channels, files.log()); !done)
    return tl::unexpected(std::move(done.error()));
  return digest_of(files);
}

}  // namespace joulecast::trial::foreign
