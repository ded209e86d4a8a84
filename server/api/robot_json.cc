#include "server/api/robot_json.h"

#include <array>
#include <cmath>

#include "answers/drive.h"
#include "answers/mission.h"

namespace joulecast::api {
namespace {

using described::Table;
using ingest::RobotSnapshot;

constexpr double live_s = 5;

const Table<ingest::ChargeView>& charge_table() {
  using V = ingest::ChargeView;
  using battery::ChargeSource;
  static const std::array sources{battery::name(ChargeSource::unknown),
                                  battery::name(ChargeSource::voltage_and_current),
                                  battery::name(ChargeSource::voltage_and_model),
                                  battery::name(ChargeSource::current), battery::name(ChargeSource::model)};
  static const auto table =
      Table<V>()
          .word("source", AT(estimate.source), sources,
                "present source of the charge estimate; model: modelled power replaces the measured current")
          .value("default_curve", AT(estimate.default_curve),
                 "true: the robot file has no open-circuit voltage, and a typical curve is used")
          .value(
              "flat_curve", AT(estimate.flat_curve),
              "true: the voltage is nearly independent of the charge here, so that the charge is estimated "
              "from the current only")
          .text_or_null(
              "limitation", [](const V& v) { return battery::limitation_of(v.estimate); },
              "why the standard deviation of the charge is large, as a sentence; null: no such reason")
          .number_or_null(
              "current_bias_a",
              [](const V& v) {
                return v.estimate.source != ChargeSource::unknown ? v.estimate.current_bias_a
                                                                  : signals::unmeasured;
              },
              "estimated offset of the battery's current sensor; null: nothing was received about the "
              "battery")
          .number_or_null("current_bias_sd_a", AT(estimate.current_bias_sd_a),
                          "standard deviation of current_bias_a")
          .number_or_null(
              "time_to_charged_s", AT(to_full.duration_s),
              "time until the end of charging; away from a charger, if charging started now; null: no "
              "charging observed yet")
          .number_or_null("time_to_charged_sd_s", AT(to_full.sd_s),
                          "standard deviation of time_to_charged_s");
  return table;
}

const answers::Quantiles& quantiles_of(const LiveState& state, answers::Quantiles forecast::Reach::*member) {
  static constexpr answers::Quantiles unknown{signals::unmeasured, signals::unmeasured, signals::unmeasured};
  return state.reach ? (*state.reach).*member : unknown;
}

}  // namespace

double silence_s(const ingest::RobotSnapshot& s, std::int64_t now_utime_us) {
  return s.received_utime_us > 0 ? static_cast<double>(now_utime_us - s.received_utime_us) * 1e-6
                                 : signals::unmeasured;
}

const Table<ingest::Contradiction>& contradiction_table() {
  using C = ingest::Contradiction;
  static const auto table =
      Table<C>({}, "a contradiction in a robot's telemetry")
          .named("contradiction")
          .word("kind", &C::kind, ingest::contradiction_kind_names, "likely kind of integration error")
          .value("id", &C::id, "identifier, such as battery_current_reversed")
          .value("channel", &C::channel,
                 "fields of robot_telemetry_t, separated by a comma; empty: no single one")
          .number_or_null(
              "value", &C::value,
              "value of the contradiction: a factor of the channel, its value, or a share of the messages")
          .value("says", &C::says,
                 "the finding, the quantity it contradicts, its likely cause and the expected input")
          .value("untrue", &C::untrue, "whether affected missions are excluded from training")
          .time("told", &C::told_utime_us,
                "time of its last report, in the log and the event log at most once per hour; microseconds "
                "since 1970 by the host's clock");
  return table;
}

const Table<ContradictionEvent>& contradiction_event_table() {
  using E = ContradictionEvent;
  static const auto table =
      Table<E>("Contradiction in the telemetry of a robot")
          .value("robot_id", AT(robot_id), "robot of the event")
          .object("contradiction", AT(contradiction), "as in the robot's state", contradiction_table());
  return table;
}

bool is_live(const ingest::RobotSnapshot& snapshot, std::int64_t now_utime_us) {
  return silence_s(snapshot, now_utime_us) <= live_s;  // false for NaN
}

const Table<LiveState>& state_table() {
  using L = LiveState;
  static const auto charging =
      Table<ingest::ChargeView>()
          .word(
              "phase", [](const ingest::ChargeView& v) { return battery::name(v.phase); },
              std::array{"constant_current", "taper", "full"}, "phase of charging")
          .time("since", AT(stay.start_utime_us),
                "start of charging, microseconds since 1970 by the robot's clock")
          .value("charged_ah", AT(stay.charged_ah), "charge put into the battery during this stay")
          .value("charged_j", AT(stay.charged_j), "energy at the battery's terminals during this stay");
  static const auto open_mission =
      Table<RobotSnapshot>()
          .value("id", &RobotSnapshot::mission_key, "number of the mission, as in /v1/missions/{id}")
          .value("mission_id", &RobotSnapshot::mission_id, "the robot's identifier of the mission")
          .time("start", &RobotSnapshot::mission_start_utime_us,
                "start, microseconds since 1970 by the robot's clock")
          .object("energy", &RobotSnapshot::accounts, "energies and their terms", answers::accounts_table());
  static const auto table =
      Table<L>("Live state of a robot")
          .named("robot-state")
          .value("robot_id", AT(snapshot.robot_id), "the robot's id, as in its telemetry and its file")
          .value("has_model", AT(snapshot.has_model),
                 "whether it has a model, so that energy can be modelled")
          .value(
              "model_version",
              [](const L& l) {
                return l.snapshot.has_model ? std::optional(l.snapshot.model_version) : std::nullopt;
              },
              "version in force; null: none")
          .value(
              "live", [](const L& l) { return is_live(l.snapshot, l.now_utime_us); },
              "true if a message was received within the last 5 s")
          .number_or_null(
              "silent_s", [](const L& l) { return silence_s(l.snapshot, l.now_utime_us); },
              "time since the last message; null: none received")
          .time(
              "",
              [](const L& l) {
                const std::int64_t utime_us = l.snapshot.sample.utime_us;
                return utime_us != 0 ? std::optional(utime_us) : std::nullopt;
              },
              "time of the last message by the robot's clock, microseconds since 1970. The members below are "
              "of this time; they are current only if the robot is live")
          .number_or_null("measured_power_w", AT(snapshot.measured_power_w),
                          "measured battery power; null: not measured")
          .number_or_null("modelled_power_w", AT(snapshot.modelled_power_w),
                          "modelled battery power; null outside missions and at a charger")
          .number_or_null("speed_m_s", AT(snapshot.speed_m_s), "forward speed; negative: backwards")
          .number_or_null("yaw_rate_rad_s", AT(snapshot.yaw_rate_rad_s),
                          "rate of turning, positive to the left")
          .numbers("pose", AT(snapshot.sample.pose), "[x_m, y_m, heading_rad] on its map; null: not measured")
          .number_or_null("payload_kg", AT(snapshot.sample.payload_kg),
                          "as declared by the robot; null: not declared")
          .number_or_null("battery_voltage_v", AT(snapshot.sample.battery_voltage_v),
                          "at the terminals; null: not measured")
          .number_or_null("battery_current_a", AT(snapshot.sample.battery_current_a),
                          "positive: discharging; null: not measured")
          .number_or_null("state_of_charge", AT(snapshot.state_of_charge), "0 to 1")
          .number_or_null("state_of_charge_sd", AT(snapshot.charge.estimate.sd),
                          "standard deviation of state_of_charge")
          .object("charge", AT(snapshot.charge), "estimation of state_of_charge", charge_table())
          .object(
              "charging",
              [](const L& l) {
                return battery::at_charger(l.snapshot.charge.phase) ? &l.snapshot.charge : nullptr;
              },
              "null: not at a charger", charging)
          .number_or_null(
              "range_m", [](const L& l) { return quantiles_of(l, &forecast::Reach::range_m)[1]; },
              "remaining range above the reserve with driving as in its recent legs: median of the forecast "
              "of POST /v1/robots/{id}/autonomy")
          .number_or_null(
              "run_time_s", [](const L& l) { return quantiles_of(l, &forecast::Reach::run_time_s)[1]; },
              "the same for run time")
          .object(
              "range_quantiles_m", [](const L& l) { return quantiles_of(l, &forecast::Reach::range_m); },
              "range at the quantiles 5, 50 and 95 % of the same forecast", answers::quantiles_table())
          .object(
              "run_time_quantiles_s",
              [](const L& l) { return quantiles_of(l, &forecast::Reach::run_time_s); },
              "run time at the quantiles 5, 50 and 95 % of the same forecast", answers::quantiles_table())
          .numbers("winding_temperature_c", AT(snapshot.winding_temperature_c),
                   "temperature of the motors' windings, [right, left]: measured, or modelled where the "
                   "model has their thermal resistance; otherwise null")
          .object(
              "mission", [](const L& l) { return l.snapshot.mission_id.empty() ? nullptr : &l.snapshot; },
              "the open mission; null: none", open_mission)
          .value("samples", AT(snapshot.samples), "samples accepted since the service started")
          .map("faults", AT(snapshot.faults),
               "messages rejected or repaired since the daemon started, by reason. restart, gap and "
               "outside_mission also occur in normal operation, by restarts and between missions")
          .map("fault_notes", AT(snapshot.fault_notes),
               "details of the last rejected message, by reason, for the reasons that have any: field, value "
               "and bound; address of the second sender")
          .list("contradictions", AT(snapshot.contradictions),
                "contradictions of the newest telemetry and of the last mission, found by comparing channels "
                "with each other, the robot file and the service's clock; empty: none",
                contradiction_table())
          .map("missions_left_out", AT(snapshot.missions_left_out),
               "missions since the service started that were not used for training, by reason. contradicted: "
               "contradicted telemetry; barely_measured: the battery was measured for less than half of the "
               "time");
  return table;
}

answers::LiveRobot live_robot(const ingest::RobotSnapshot* snapshot) {
  answers::LiveRobot now;
  if (snapshot == nullptr) return now;
  now.state_of_charge = snapshot->state_of_charge;
  now.state_of_charge_sd = snapshot->charge.estimate.sd;
  now.charge_limitation = battery::limitation_of(snapshot->charge.estimate);
  now.charging = snapshot->charge.phase;
  now.to_full = snapshot->charge.to_full;
  now.speed_m_s = snapshot->speed_m_s;
  const signals::Sample& sample = snapshot->sample;
  if (sample.utime_us == 0) return now;
  now.battery_voltage_v = sample.battery_voltage_v;
  now.battery_current_a = sample.battery_current_a;
  const auto& pose = sample.pose;
  if (std::isfinite(pose[0] + pose[1] + pose[2])) now.pose = planning::Pose{pose[0], pose[1], pose[2]};
  if (std::isfinite(sample.payload_kg)) now.payload_kg = sample.payload_kg;
  return now;
}

}  // namespace joulecast::api
