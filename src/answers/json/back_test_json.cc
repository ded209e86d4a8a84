#include "answers/json/back_test_json.h"

#include <array>
#include <string_view>

namespace joulecast::answers {
namespace {

const described::Table<energy::ModelError>& error_table() {
  using E = energy::ModelError;
  static const auto table =
      described::Table<E>()
          .number_or_null("energy_j", &E::energy_j, "modelled energy over the measured time")
          .number_or_null("relative", &E::relative, "modelled / measured - 1")
          .numbers("ci", &E::interval, "95 % interval")
          .number_or_null(
              "power_absolute_relative", &E::power_absolute_relative,
              "sum of |modelled - measured| energy over half seconds, relative to measured energy");
  return table;
}

const described::Table<energy::RunComparison>& run_table() {
  using R = energy::RunComparison;
  static const auto table =
      described::Table<R>()
          .value("id", &R::id, "as in /v1/missions/{id}; null: of a log")
          .value("mission_id", &R::name, "the robot's identifier of the mission")
          .word(
              "basis", [](const R& r) -> std::string_view { return r.at_battery ? "battery" : "motors"; },
              std::array<std::string_view, 2>{"battery", "motors"}, "where the energy was measured")
          .value("measured_j", &R::measured_j,
                 "energy from the battery by the sensors of voltage and current")
          .value("duration_s", &R::duration_s, "from start to end")
          .object("before", &R::before, "by the model in force", error_table())
          .object("after", &R::after, "by the new model", error_table());
  return table;
}

}  // namespace

const described::Table<energy::BackTest>& back_test_table() {
  using B = energy::BackTest;
  const auto of_runs = [](double B::*figure) {
    return [figure](const B& test) { return test.runs.empty() ? energy::ModelError::unknown : test.*figure; };
  };
  static const auto table =
      described::Table<B>()
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
