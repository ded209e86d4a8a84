#include "answers/json/ledger_json.h"

#include <cmath>

#include "signals/sample.h"

namespace joulecast::answers {
namespace {

using signals::Accounts;

// In the order of signals::Term.
constexpr std::array<std::string_view, signals::term_count> term_words = {
    "computers, sensors, lights and all other consumers at standstill",
    "lost in the motor drivers",
    "heat of the motor windings; metered, without that of currents that vary between two samples",
    "lost at the brushes",
    "friction of motors, gears and bearings",
    "rolling of the wheels on the floor",
    "tyres that scrub over the floor in turns",
    "friction of a part of the floor",
    "slip of driven wheels",
    "drag of the air",
    "change of the kinetic energy of robot and wheels",
    "change of the potential energy",
    "turned to heat in braking; metered, without what varies between two samples",
    "returned to the battery in braking, positive; it counts negative in the sum",
    "contribution of a sensor error to the measured energy",
    "measured minus modelled; null: not measured"};

double if_measured(const Accounts& a, double energy_j) {
  return a.measured_s > 0 ? energy_j : signals::unmeasured;
}

std::array<double, 2> measured_motors(const Accounts& a) {
  if (a.motor_measured_s > 0) return a.measured_motor_j;
  return {signals::unmeasured, signals::unmeasured};
}

double closure_relative(const Accounts& a) {
  return a.battery_j != 0 ? std::fabs(a.ledger.total() - a.battery_j) / std::fabs(a.battery_j) : 0.0;
}

described::Table<signals::Ledger> make_terms() {
  described::Table<signals::Ledger> table("Terms of the ledger", "recovered counts negative in the sum");
  for (std::size_t k = 0; k < signals::term_count; ++k)
    table.value(
        std::string(signals::term_names[k]), [k](const signals::Ledger& ledger) { return ledger.value[k]; },
        term_words[k]);
  return table;
}

}  // namespace

const described::Table<Accounts>& accounts_table() {
  static const auto table =
      described::Table<Accounts>("Energy accounts of an interval of driving",
                                 "energy accounts in joules; sides are [right, left]")
          .named("accounts")
          .value("battery_j", &Accounts::battery_j,
                 "battery energy, measured where available, else modelled; positive out of the battery")
          .number_or_null(
              "measured_j", [](const Accounts& a) { return if_measured(a, a.measured_j); },
              "measured at the battery terminals; null: never measured")
          .value("measured_s", &Accounts::measured_s, "time that measured_j covers")
          .numbers("measured_motor_j", measured_motors,
                   "energy into the motors by their sensors, [right, left]; null: not measured")
          .value("motor_measured_s", &Accounts::motor_measured_s, "time in which the motors were measured")
          .value("modelled_j", &Accounts::modelled_j,
                 "modelled at the battery terminals, from the measured motion")
          .numbers("modelled_motor_j", &Accounts::modelled_motor_j,
                   "energy into the motors by the model, [right, left]", false)
          .number_or_null(
              "unexplained_j",
              [](const Accounts& a) { return if_measured(a, a.ledger[signals::Term::unexplained]); },
              "measured minus modelled, integrated separately")
          .value("drawn_j", &Accounts::drawn_j, "energy while power flowed out of the battery")
          .value("returned_j", &Accounts::returned_j, "energy while power flowed into the battery, positive")
          .value("charge_ah", &Accounts::charge_ah,
                 "net charge drawn from the battery: discharged minus returned")
          .value("distance_m", &Accounts::distance_m, "driven distance, forward and backward both positive")
          .value("turned_rad", &Accounts::turned_rad, "turned angle, both senses positive")
          .value("duration_s", &Accounts::duration_s, "from start to end");
  return table;
}

const described::Table<signals::Ledger>& terms_table() {
  static const auto table = make_terms();
  return table;
}

const described::Table<Accounts>& ledger_table() {
  static const auto table =
      described::Table<Accounts>("Ledger of an interval of driving")
          .named("ledger")
          .value("battery_j", &Accounts::battery_j,
                 "energy from the battery, the sum of the terms where it is measured")
          .object("terms_j", &Accounts::ledger, {}, terms_table())
          .value(
              "sum_j", [](const Accounts& a) { return a.ledger.total(); },
              "sum of the terms, recovered counted negative")
          .value("closure_relative", closure_relative, "|sum - battery| / |battery|", {{"minimum", 0}});
  return table;
}

}  // namespace joulecast::answers
