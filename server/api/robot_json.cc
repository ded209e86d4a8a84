#include "server/api/robot_json.h"

#include "answers/json/drive_json.h"
#include "answers/json/ledger_json.h"

namespace joulecast::api {
namespace {

constexpr double live_s = 5;

void write_sides(JsonWriter& json, std::string_view name, const std::array<double, 2>& sides) {
  json.key(name).begin_array().value(sides[0]).value(sides[1]).end_array();
}

}  // namespace

double silence_s(const ingest::RobotSnapshot& s, std::int64_t now_utime_us) {
  return s.received_utime_us > 0 ? static_cast<double>(now_utime_us - s.received_utime_us) * 1e-6
                                 : signals::unmeasured;
}

void write_charge(JsonWriter& json, const ingest::ChargeView& charge) {
  const battery::ChargeEstimate& estimate = charge.estimate;
  json.key("charge").begin_object();
  json.field("source", battery::name(estimate.source));
  json.field("default_curve", estimate.default_curve);
  json.field("flat_curve", estimate.flat_curve);
  const bool heard = estimate.source != battery::ChargeSource::unknown;
  json.field("current_bias_a", heard ? estimate.current_bias_a : signals::unmeasured);
  json.field("current_bias_sd_a", estimate.current_bias_sd_a);
  json.field("time_to_charged_s", charge.to_full.duration_s);
  json.field("time_to_charged_sd_s", charge.to_full.sd_s);
  json.end_object();
  json.key("charging");
  if (!battery::at_charger(charge.phase)) {
    json.null();
    return;
  }
  json.begin_object();
  json.field("phase", battery::name(charge.phase));
  json.time("since", charge.stay.start_utime_us);
  json.field("charged_ah", charge.stay.charged_ah);
  json.field("charged_j", charge.stay.charged_j);
  json.end_object();
}

void write_contradiction(JsonWriter& json, const ingest::Contradiction& c) {
  json.begin_object();
  json.field("kind", ingest::contradiction_kind_names[static_cast<std::size_t>(c.kind)]);
  json.field("id", c.id).field("channel", c.channel).field("value", c.value).field("says", c.says);
  json.field("untrue", c.untrue);
  json.time("told", c.told_utime_us);
  json.end_object();
}

bool is_live(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us) {
  return silence_s(snapshot, now_utime_us) <= live_s;  // false for NaN
}

void write_state(JsonWriter& json, const ingest::RobotSnapshot& s,
                 const std::optional<forecast::Reach>& reach, std::int64_t now_utime_us) {
  json.begin_object();
  json.field("robot_id", s.robot_id);
  json.field("has_model", s.has_model);
  json.key("model_version");
  s.has_model ? json.value(s.model_version) : json.null();
  json.field("live", is_live(s, now_utime_us));
  json.field("silent_s", silence_s(s, now_utime_us));
  json.time("", s.sample.utime_us != 0 ? std::optional(s.sample.utime_us) : std::nullopt);
  json.field("measured_power_w", s.measured_power_w);
  json.field("modelled_power_w", s.modelled_power_w);
  json.field("speed_m_s", s.speed_m_s);
  json.field("yaw_rate_rad_s", s.yaw_rate_rad_s);
  json.key("pose").begin_array();
  for (const double p : s.sample.pose) json.value(p);
  json.end_array();
  json.field("payload_kg", s.sample.payload_kg);
  json.field("battery_voltage_v", s.sample.battery_voltage_v);
  json.field("battery_current_a", s.sample.battery_current_a);
  json.field("state_of_charge", s.state_of_charge);
  json.field("state_of_charge_sd", s.charge.estimate.sd);
  write_charge(json, s.charge);
  constexpr std::array<double, 3> unknown{signals::unmeasured, signals::unmeasured, signals::unmeasured};
  const std::array<double, 3>& range = reach ? reach->range_m : unknown;
  const std::array<double, 3>& run_time = reach ? reach->run_time_s : unknown;
  json.field("range_m", range[1]).field("run_time_s", run_time[1]);
  answers::quantiles_table().write(json.key("range_quantiles_m"), range);
  answers::quantiles_table().write(json.key("run_time_quantiles_s"), run_time);
  write_sides(json, "winding_temperature_c", s.winding_temperature_c);
  json.key("mission");
  if (s.mission_id.empty()) {
    json.null();
  } else {
    json.begin_object();
    json.field("id", s.mission_key);
    json.field("mission_id", s.mission_id);
    json.time("start", s.mission_start_utime_us);
    json.key("energy");
    answers::accounts_table().write(json, s.accounts);
    json.end_object();
  }
  json.field("samples", s.samples);
  json.key("faults").begin_object();
  for (const auto& [reason, count] : s.faults) json.field(reason, count);
  json.end_object();
  json.key("fault_notes").begin_object();
  for (const auto& [reason, note] : s.fault_notes) json.field(reason, note);
  json.end_object();
  json.key("contradictions").begin_array();
  for (const ingest::Contradiction& c : s.contradictions) write_contradiction(json, c);
  json.end_array();
  json.key("missions_left_out").begin_object();
  for (const auto& [reason, count] : s.missions_left_out) json.field(reason, count);
  json.end_object();
  json.end_object();
}

}  // namespace joulecast::api
