#include "server/api/mission_json.h"

#include <cmath>

namespace joulecast::api {

void write_accounts(JsonWriter& json, const signals::Accounts& a) {
  const bool battery = a.measured_s > 0, motors = a.motor_measured_s > 0;
  const double unmeasured = signals::unmeasured;
  json.begin_object();
  json.field("battery_j", a.battery_j);
  json.field("measured_j", battery ? a.measured_j : unmeasured);
  json.field("measured_s", a.measured_s);
  json.key("measured_motor_j").begin_array();
  for (const double motor : a.measured_motor_j) json.value(motors ? motor : unmeasured);
  json.end_array();
  json.field("motor_measured_s", a.motor_measured_s);
  json.field("modelled_j", a.modelled_j);
  json.key("modelled_motor_j")
      .begin_array()
      .value(a.modelled_motor_j[0])
      .value(a.modelled_motor_j[1])
      .end_array();
  json.field("unexplained_j", battery ? a.ledger[signals::Term::unexplained] : unmeasured);
  json.field("drawn_j", a.drawn_j);
  json.field("returned_j", a.returned_j);
  json.field("charge_ah", a.charge_ah);
  json.field("distance_m", a.distance_m);
  json.field("turned_rad", a.turned_rad);
  json.field("duration_s", a.duration_s);
  json.end_object();
}

void write_ledger(JsonWriter& json, const signals::Accounts& a) {
  const double sum = a.ledger.total();
  json.begin_object();
  json.field("battery_j", a.battery_j);
  json.key("terms_j").begin_object();
  for (std::size_t k = 0; k < signals::term_count; ++k) json.field(signals::term_names[k], a.ledger.value[k]);
  json.end_object();
  json.field("sum_j", sum);
  json.field("closure_relative",
             a.battery_j != 0 ? std::fabs(sum - a.battery_j) / std::fabs(a.battery_j) : 0.0);
  json.end_object();
}

void write_mission(JsonWriter& json, const history::Mission& m) {
  json.begin_object();
  json.field("id", m.key);
  json.field("robot_id", m.robot_id);
  json.field("mission_id", m.mission_id);
  json.field("state", history::name(m.state));
  json.field("implicit", m.implicit);
  json.field("incomplete", m.incomplete);
  json.key("incomplete_reason");
  m.incomplete_reason.empty() ? json.null() : json.value(m.incomplete_reason);
  json.field("start_utime_us", m.start_utime_us);
  json.field("end_utime_us", m.end_utime_us);
  json.field("payload_kg", m.payload_kg);
  json.field("note", m.note);
  json.field("model_version", m.model_version);
  json.key("energy");
  write_accounts(json, m.accounts);
  json.field("samples", m.samples);
  json.key("sample_faults").begin_object();
  for (const auto& [reason, count] : m.sample_faults) json.field(reason, count);
  json.end_object();
  json.field("gap_count", m.gap_count);
  json.field("gap_s", m.gap_s);
  json.key("findings");
  m.findings_json.empty() ? json.null() : json.raw(m.findings_json);
  json.key("covariates").begin_array();
  for (const history::CovariateSummary& c : m.covariates) {
    json.begin_object().field("name", c.name).field("mean", c.mean).field("min", c.min).field("max", c.max);
    json.field("known_s", c.known_s).end_object();
  }
  json.end_array();
  json.end_object();
}

}  // namespace joulecast::api
