#include "answers/json/mission_json.h"

#include <utility>

#include "answers/json/ledger_json.h"
#include "signals/account_ratios.h"

namespace joulecast::answers {
namespace {

using described::of_array;
using described::of_object;
using described::of_type;
using described::or_null;
using described::Schema;
using described::Table;
using described::with_words;
using history::Mission;

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
                      "inseparable: payload is not distinguished from friction and slope by this motion")},
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
  return of_array(of_object(
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

const Table<history::MissionFindings>& findings_table() {
  using F = history::MissionFindings;
  const Schema annulled = of_object(
      {}, {},
      {{"utime_us",
        with_words(of_type("integer"), "time of the event, microseconds since 1970 by the host's clock")},
       {"reason", text("reason of the annulment")}});
  static const auto table =
      Table<F>()
          .json("findings", &F::motion,
                "payload and friction estimated from the mission's motion; null: not yet estimated, or too "
                "little motion",
                findings_schema())
          .json("contradictions", &F::contradictions,
                "contradictions in the telemetry: the accounts are unreliable and no model is trained with "
                "the mission; empty: none",
                contradictions_schema())
          .json("annulled", &F::annulled, "time and reason of the annulment; null: not annulled",
                or_null(annulled));
  return table;
}

}  // namespace

const Table<Mission>& mission_table() {
  using M = Mission;
  using Covariate = history::CovariateSummary;
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
          .word(
              "state", [](const M& m) { return history::name(m.state); },
              history::names_of<history::MissionState>,
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
          .include(findings_table(), history::findings_of)
          .list("covariates", &M::covariates,
                "further readings of the robot (ROBOT_COVARIATES); empty: nothing", covariate);
  return table;
}

const described::Table<drift::Mark>& mark_table() {
  using M = drift::Mark;
  static const auto table =
      described::Table<M>()
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

}  // namespace joulecast::answers
