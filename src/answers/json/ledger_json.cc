#include "answers/json/ledger_json.h"

#include <cmath>

#include "signals/sample.h"

namespace joulecast::answers {

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

}  // namespace joulecast::answers
