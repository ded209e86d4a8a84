#include <nlohmann/json.hpp>

#include "describe/input.h"
#include "gap/runs/diagnose_runs.h"
#include "gap/verdict/diagnosis_json.h"

namespace joulecast::gap {

nlohmann::ordered_json runs_to_json(const RunDiagnosis& diagnosis) {
  using described::Table;
  using J = JudgedRun;
  static const auto run =
      Table<J>()
          .value("run", AT(run.name), "name of the run")
          .value("table", AT(run.table), "name of its table")
          .number_or_null(
              "measured_j", [](const J& judged) { return judged.run.measured_j(); }, "measured energy")
          .number_or_null("model_j", &J::model_j, "energy by the model")
          .number_or_null("with_effects_j", &J::after_j, "the same with the effects found")
          .number_or_null("held_out_j", &J::held_out_j, "the same with the effects found without this run");
  using R = RunDiagnosis;
  static const auto model =
      Table<R>()
          .value("given", &R::model_given, "the energies of the model are those of the table of runs")
          .number_or_null("given_over_robot_file", &R::model_ratio, "their ratio to those of the robot file");
  static const auto scatter =
      Table<R>()
          .number_or_null("run", &R::scatter, "standard deviation from run to run, relative to the energy")
          .number_or_null("side_difference", &R::side_scatter, "the same of right minus left");
  static const auto table =
      Table<R>("Diagnosis of energies of runs, as printed by `joulecast gap --missions --json`")
          .include(diagnosis_table(), &R::diagnosis)
          .value(
              "kind", [](const R&) { return "mission_energies"; }, "distinguishes it from other diagnoses")
          .object("model", std::identity(), "the model that was diagnosed", model)
          .object("scatter", std::identity(), "differences between runs that no effect explains", scatter)
          .texts("limits", &R::limits, "limits of these energies, in sentences")
          .list("runs", &R::runs, "the runs, one by one", run);
  return table.document(diagnosis);
}

}  // namespace joulecast::gap
