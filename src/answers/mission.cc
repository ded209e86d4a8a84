#include "answers/mission.h"

#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "signals/sample.h"

namespace joulecast::answers {
namespace {

using described::of_object;
using described::of_type;
using described::or_null;
using described::Schema;
using described::Table;
using described::with_words;
using history::Mission;
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

Table<signals::Ledger> make_terms() {
  Table<signals::Ledger> table("Terms of the ledger", "recovered counts negative in the sum");
  for (std::size_t k = 0; k < signals::term_count; ++k)
    table.value(
        std::string(signals::term_names[k]), [k](const signals::Ledger& ledger) { return ledger.value[k]; },
        term_words[k]);
  return table;
}

const Table<energy::RunComparison>& run_table() {
  using R = energy::RunComparison;
  static const auto error =
      Table<energy::ModelError>()
          .number_or_null("energy_j", &energy::ModelError::energy_j, "modelled energy over the measured time")
          .number_or_null("relative", &energy::ModelError::relative, "modelled / measured - 1")
          .numbers("ci", &energy::ModelError::interval, "95 % interval")
          .number_or_null(
              "power_absolute_relative", &energy::ModelError::power_absolute_relative,
              "sum of |modelled - measured| energy over half seconds, relative to measured energy");
  static const auto table =
      Table<R>()
          .value("id", &R::id, "as in /v1/missions/{id}; null: of a log")
          .value("mission_id", &R::name, "the robot's identifier of the mission")
          .word(
              "basis", [](const R& r) -> std::string_view { return r.at_battery ? "battery" : "motors"; },
              std::array<std::string_view, 2>{"battery", "motors"}, "where the energy was measured")
          .value("measured_j", &R::measured_j,
                 "energy from the battery by the sensors of voltage and current")
          .value("duration_s", &R::duration_s, "from start to end")
          .object("before", &R::before, "by the model in force", error)
          .object("after", &R::after, "by the new model", error);
  return table;
}

Schema number(std::string_view words) {
  return with_words(of_type("number"), words);
}

Schema text(std::string_view words) {
  return with_words(of_type("string"), words);
}

// As the refinement of the robot's parameters writes it.
Schema findings_schema() {
  Schema parameters = of_type("object");
  parameters["additionalProperties"] = of_object({}, {},
                                                 {{"value", number("refined value, in the unit of its name")},
                                                  {"sd", number("standard deviation")},
                                                  {"in_force", number("value of the model in force")}});
  return or_null(of_object(
      {}, {},
      {{"equations",
        with_words(of_type("integer"), "segments of the recording that the estimate is based on")},
       {"learned_from", with_words(of_type("boolean"),
                                   "whether the mission is used for the robot's refined parameters; others "
                                   "are held back for back-tests")},
       {"payload",
        with_words(
            of_object(
                {}, {},
                {{"verdict",
                  with_words(
                      {{"enum", {"as_declared", "undeclared", "inseparable"}}},
                      "inseparable: payload is not distinguished from friction and slope by this motion, "
                      "or the file's mass is greater than that of the robot")},
                 {"declared_kg", number("mean over the mission")},
                 {"undeclared_kg", number("estimated payload beyond the declared one")},
                 {"undeclared_sd_kg", number("standard deviation, including the uncertainty of friction, "
                                             "slope, the robot's mass and the sensors")}}),
            "whether the payload is the declared one")},
       {"torque_rms_nm",
        with_words(of_type("number", true), "root mean square of the torque residual of the refined model")},
       {"surprise", number("squared Mahalanobis distance from the prediction of earlier missions, divided by "
                           "its dimension; 1 is usual")},
       {"parameters",
        with_words(std::move(parameters),
                   "estimates from this mission alone; a single mission does not correct the model. mass_kg "
                   "contains any undeclared payload: see payload; in_force: the value of the model")}}));
}

Schema contradictions_schema() {
  return described::of_array(of_object(
      {}, {},
      {{"kind", text("as in the robot's state")},
       {"id", text("identifier, such as battery_current_reversed")},
       {"channel", text("fields of robot_telemetry_t, separated by a comma; empty: no single one")},
       {"value",
        with_words(
            of_type("number", true),
            "value of the contradiction: a factor of the channel, its value, or a share of the messages")},
       {"says", text("the finding, the quantity it contradicts, its likely cause and the expected input")}}));
}

}  // namespace

const Table<Accounts>& accounts_table() {
  static const auto table =
      Table<Accounts>("Energy accounts of an interval of driving",
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

const Table<signals::Ledger>& terms_table() {
  static const auto table = make_terms();
  return table;
}

const Table<Accounts>& ledger_table() {
  static const auto table =
      Table<Accounts>("Ledger of an interval of driving")
          .named("ledger")
          .value("battery_j", &Accounts::battery_j,
                 "energy from the battery, the sum of the terms where it is measured")
          .object("terms_j", &Accounts::ledger, {}, terms_table())
          .value("sum_j", AT(ledger.total()), "sum of the terms, recovered counted negative")
          .value("closure_relative", closure_relative, "|sum - battery| / |battery|", {{"minimum", 0}});
  return table;
}

const Table<Mission>& mission_table() {
  using M = Mission;
  using Covariate = history::CovariateSummary;
  const Schema annulled = of_object(
      {}, {},
      {{"utime_us",
        with_words(of_type("integer"), "time of the event, microseconds since 1970 by the host's clock")},
       {"reason", text("reason of the annulment")}});
  static const auto findings =
      Table<history::MissionFindings>()
          .json("findings", &history::MissionFindings::motion,
                "payload and friction estimated from the mission's motion; null: not yet estimated, or too "
                "little motion",
                findings_schema())
          .json("contradictions", &history::MissionFindings::contradictions,
                "contradictions in the telemetry: the accounts are unreliable and no model is trained with "
                "the mission; empty: none",
                contradictions_schema())
          .json("annulled", &history::MissionFindings::annulled,
                "time and reason of the annulment; null: not annulled", or_null(annulled));
  static const auto covariate =
      Table<Covariate>()
          .value("name", &Covariate::name, "with its unit; a label as name=label")
          .number_or_null(
              "mean", &Covariate::mean,
              "mean over the time with values; of a label the share of that time in which it was set")
          .number_or_null("min", &Covariate::min, "least")
          .number_or_null("max", &Covariate::max, "greatest")
          .value("known_s", &Covariate::known_s, "time with values");
  static const auto table =
      Table<M>("A mission")
          .named("mission")
          .value("id", &M::key, "number of the mission, as in /v1/missions/{id}")
          .value("robot_id", &M::robot_id, "the robot's id, as in its telemetry and its file")
          .value("mission_id", &M::mission_id, "the robot's identifier of the mission")
          .word("state", &M::state, history::names_of<history::MissionState>,
                "open: running; unfinished: its end was never reported; superseded: another mission began "
                "before its end; interrupted: the service was stopped")
          .value("implicit", &M::implicit, "opened by the service, without an announcement by the robot")
          .value("incomplete", &M::incomplete,
                 "has parts without telemetry, which are not included in the energy")
          .text_or_null("incomplete_reason", &M::incomplete_reason,
                        "reason of incompleteness; null: complete")
          .time("start", &M::start_utime_us, "start, microseconds since 1970 by the robot's clock")
          .time("end", &M::end_utime_us,
                "end, or the last sample so far; microseconds since 1970 by the robot's clock")
          .number_or_null("payload_kg", &M::payload_kg, "as declared; null when not")
          .value("note", &M::note, "the robot's note at the start of the mission")
          .value("model_version", &M::model_version,
                 "model version of the modelled energy; null: the robot had none")
          .object("energy", &M::accounts, "energies and their terms", accounts_table())
          .number_or_null(
              "ratio", [](const M& m) { return signals::energy_ratio(m.accounts); },
              "measured over modelled energy during measurement; null: not measured")
          .number_or_null(
              "wh_per_km", [](const M& m) { return signals::energy_per_distance_wh_km(m.accounts); },
              "battery energy over distance; null below 0.1 m")
          .value("samples", &M::samples, "samples of telemetry")
          .map("sample_faults", &M::sample_faults, "samples refused or repaired, by reason")
          .value("gap_count", &M::gap_count, "gaps in the telemetry")
          .value("gap_s", &M::gap_s, "time without telemetry")
          .include(findings, history::findings_of)
          .list("covariates", &M::covariates,
                "further readings of the robot (ROBOT_COVARIATES); empty: nothing", covariate);
  return table;
}

const Table<drift::Mark>& mark_table() {
  using M = drift::Mark;
  static const auto table =
      Table<M>()
          .value("id", &M::mission_key, "the first mission after the change, as in /v1/missions/{id}")
          .time("start", &M::utime_us, "start of the mission, microseconds since 1970 by the robot's clock")
          .value("model_version", &M::model_version, "the version then in force")
          .word("quantity", &M::quantity_name, drift::quantity_names, "what changed, over the model's")
          .value("ratio_before", &M::before, "measured over modelled before the change")
          .value("ratio_after", &M::after, "the same after it, by the missions that revealed it")
          .numbers("change_ci", &M::interval, "95 % interval of the difference")
          .value("missions", &M::missions, "number of missions");
  return table;
}

const Table<energy::BackTest>& back_test_table() {
  using B = energy::BackTest;
  const auto of_runs = [](double B::*figure) {
    return [figure](const B& test) { return test.runs.empty() ? energy::ModelError::unknown : test.*figure; };
  };
  static const auto table =
      Table<B>()
          .list("missions", &B::runs, "the missions that were replayed, one by one", run_table())
          .number_or_null("error_before", of_runs(&B::error_before),
                          "sum of |energy error| over sum of measured energy; null without missions")
          .number_or_null("error_after", of_runs(&B::error_after), "error_before, with the new model")
          .number_or_null(
              "improvement",
              [](const B& test) {
                return test.runs.empty() ? energy::ModelError::unknown : test.improvement();
              },
              "error_before - error_after")
          .numbers("improvement_ci", &B::improvement_interval, "95 % interval")
          .number_or_null(
              "power_gap_before", of_runs(&B::power_gap_before),
              "sum of |modelled - measured| energy over half seconds of all missions, relative to "
              "measured energy; errors of opposite sign do not cancel")
          .number_or_null("power_gap_after", of_runs(&B::power_gap_after),
                          "power_gap_before, with the new model")
          .numbers("power_gap_fall_ci", &B::power_gap_fall_interval,
                   "of power_gap_before - power_gap_after, 95 % interval")
          .number_or_null(
              "voltage_gap_before", of_runs(&B::voltage_gap_before),
              "sum of |change of battery voltage - change by its current and resistance| from one "
              "half second to the next, relative to the changes of voltage; null: not measured")
          .number_or_null("voltage_gap_after", of_runs(&B::voltage_gap_after),
                          "voltage_gap_before, with the new model")
          .numbers("voltage_gap_fall_ci", &B::voltage_gap_fall_interval,
                   "of voltage_gap_before - voltage_gap_after, 95 % interval")
          .value("improves", &B::improves,
                 "the energy error, the power gap or the voltage gap decreases significantly (its 95 % "
                 "interval is above zero), neither gap increases, and the energy error does not increase "
                 "significantly");
  return table;
}

}  // namespace joulecast::answers
