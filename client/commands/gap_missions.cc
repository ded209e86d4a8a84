#include "client/commands/gap_missions.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "client/commands/gap_output.h"
#include "client/files.h"
#include "client/progress.h"
#include "client/wrapped.h"
#include "gap/mission_level.h"

namespace joulecast::client {
namespace {

void print_left_out(const gap::LeftOut& l) {
  std::printf("  %-22s %3zu runs: %5.1f %% -> %5.1f %%, falls by %.0f %% [%.0f, %.0f]\n", l.what.c_str(),
              l.runs, 100 * l.before, 100 * l.after, l.before > 0 ? 100 * (1 - l.after / l.before) : 0.0,
              100 * l.interval[0], 100 * l.interval[1]);
}

void print(const gap::MissionDiagnosis& d, const nlohmann::json& effects) {
  std::printf("%s: energies of %zu runs, model by %s\n", d.robot_id.c_str(), d.runs.size(),
              d.model_given ? "the table" : "the robot file");
  std::printf("gap: energy %+.1f %%, mean absolute error of a run %.1f %% (scatter alone makes %.1f %%)\n",
              100 * d.energy_relative, 100 * d.error, 100 * d.scatter);
  const auto verdict = gap::name_of(d.verdict);
  std::printf("verdict: %.*s (probability %.2f)\n", static_cast<int>(verdict.size()), verdict.data(),
              d.verdict_probability);
  for (const nlohmann::json& e : effects) print_effect(e);
  if (!d.outside.empty()) {
    std::printf("  outside the catalogue: follows %s (probability %.2f)\n", d.outside.c_str(),
                d.outside_probability);
  }
  std::printf("mean absolute error of runs left out, everything fitted without them:\n");
  print_left_out(d.left_out);
  std::printf("    the same effects were named in %zu of %zu fits\n", d.folds_agreeing, d.folds);
  for (const gap::LeftOut& l : d.conditions) {
    print_left_out(l);
    std::printf("    named:");
    for (const std::string& id : l.effects) std::printf(" %s", id.c_str());
    std::printf("%s\n", l.effects.empty() ? " nothing" : "");
  }
  if (d.turning) {
    const gap::TurningTerm& t = *d.turning;
    std::printf(
        "turning term: wheel speeds by (2v +- l yaw)/(2r) would shift the sides of %zu turning runs by %.1f "
        "%% "
        "of\n  their energy and the sum by %+.2f %%; found is %.2f +- %.2f of that (1: halved, 0: right). "
        "With "
        "the whole term\n  the error of single motors goes from %.1f %% to %.1f %%\n",
        t.runs, 100 * t.side_difference, 100 * t.sum, t.share, t.share_sd, 100 * t.motor_error_before,
        100 * t.motor_error_after);
  }
  std::printf("limits:\n");
  for (const std::string& limit : d.limits) std::printf("  - %s\n", limit.c_str());
  if (!d.not_visible.empty()) {
    std::printf("  - These runs say nothing of:");
    for (const std::string& id : d.not_visible) std::printf(" %s", id.c_str());
    std::printf("\n");
  }
}

}  // namespace

std::string run_columns_help() {
  constexpr std::size_t column_width = 28;
  std::string help = "Columns of a table of runs:";
  for (const gap::RunColumn& column : gap::run_columns()) {
    std::string row =
        "  " + std::string(column.name) + (column.unit.empty() ? "" : " [" + std::string(column.unit) + "]");
    row.resize(std::max(row.size() + 1, column_width), ' ');
    help += '\n' + row + wrapped(column.meaning, help_width(), row.size());
  }
  return help;
}

Exit gap_from_missions(const GapMissionsOptions& options, const robot::RobotModel& robot) {
  const auto text = read_file(options.runs);
  if (!text) return report(text.error());
  const auto runs = gap::read_mission_runs(*text, options.runs, robot);
  if (!runs)
    return report({runs.error().fault, runs.error().field,
                   runs.error().message + "; joulecast gap --help lists the columns"});
  const auto diagnosis = [&] {
    Progress progress("diagnosing", "%", 100);
    return gap::diagnose_runs(*runs, robot, {options.robot_model, progress.shares()});
  }();
  if (!diagnosis) return report(diagnosis.error());
  const nlohmann::json document = gap::to_json(*diagnosis);
  if (options.json) {
    std::printf("%s\n", document.dump(2).c_str());
  } else {
    print(*diagnosis, document["effects"]);
  }
  if (!options.report.empty()) {
    const auto page = gap::report_html(*diagnosis, robot, report_origin({options.runs}, options.robot_file));
    if (const auto written = write_file(options.report, page); !written) return report(written.error());
  }
  return options.apply.empty() ? Exit::ok : write_adopted(diagnosis->adoptable, robot, options.apply);
}

}  // namespace joulecast::client
