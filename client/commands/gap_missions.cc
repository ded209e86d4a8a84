#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/try.h"
#include "client/commands/gap_output.h"
#include "client/commands/gap_parts.h"
#include "client/files.h"
#include "client/progress.h"
#include "client/wrapped.h"
#include "gap/runs/runs_json.h"

namespace joulecast::client {
namespace {

void print_runs_rest(const gap::RunDiagnosis& r) {
  fmt::print("model by {}; scatter of the runs {:.1f} % in addition to any cause\n",
             r.model_given ? "the table" : "the robot file", 100 * r.scatter);
  if (!r.conditions.empty())
    fmt::print("mean error of the runs of one condition, with all of them held out:\n");
  for (const gap::LeftOut& l : r.conditions) {
    fmt::print("  {:<22} {:3} runs: {:5.1f} % -> {:5.1f} % (regression {:.1f} %), named:", l.what, l.runs,
               100 * l.before, 100 * l.after, 100 * l.referee);
    for (const std::string& id : l.effects) fmt::print(" {}", id);
    fmt::print("{}\n", l.effects.empty() ? " nothing" : "");
  }
  fmt::print("limits:\n");
  for (const std::string& limit : r.limits) fmt::print("  - {}\n", wrapped(limit, help_width(), 4));
  if (r.not_visible.empty()) return;
  fmt::print("  - Not detectable in these runs:");
  for (const std::string& id : r.not_visible) fmt::print(" {}", id);
  fmt::print("\n");
}

Result<gap::RunSet> read_tables(const GapOptions& options, const robot::RobotModel& robot) {
  std::vector<gap::RunFile> files;
  for (const std::string& name : options.runs) {
    TRY_ASSIGN(auto text, read_file(name));
    files.push_back({name, std::move(text)});
  }
  auto runs = gap::read_runs(files, robot);
  if (!runs) runs.error().message += "; joulecast gap --help lists the columns";
  return runs;
}

Result<Exit> compare(const GapOptions& options, const gap::RunSet& runs, const robot::RobotModel& robot) {
  TRY_ASSIGN(const auto groups, runs.groups_by(options.compare_by));
  return compare_and_print(
      [&](const gap::Progress& progress) { return gap::compare_runs(runs, groups, robot, progress); }, robot,
      options, report_origin(options.runs, options.robot_file));
}

}  // namespace

std::string run_columns_help() {
  constexpr std::size_t column_width = 28;
  std::string help = "Columns of a table of runs:";
  for (const gap::RunColumn& column : gap::run_columns()) {
    std::string row = "  " + std::string(column.name) +
                      (column.unit.empty() ? "" : std::string(" [").append(column.unit).append("]"));
    row.resize(std::max(row.size() + 1, column_width), ' ');
    help += '\n' + row + wrapped(column.meaning, help_width(), row.size());
  }
  return help;
}

Result<Exit> gap_from_missions(const GapOptions& options, const robot::RobotModel& robot) {
  TRY_ASSIGN(const auto runs, read_tables(options, robot));
  if (!options.compare_by.empty()) return compare(options, runs, robot);
  const auto diagnosed = [&] {
    Progress progress("diagnosing", "%", 100);
    return gap::diagnose_runs(runs, robot, options.robot_model, progress.shares());
  };
  TRY_ASSIGN(const auto diagnosis, diagnosed());
  const nlohmann::ordered_json document = gap::runs_to_json(diagnosis);
  if (options.json) {
    fmt::print("{}\n", document.dump(2));
  } else {
    print_diagnosis(document);
    print_runs_rest(diagnosis);
  }
  if (!options.report.empty()) {
    const auto page = report::report_html(document, robot, report_origin(options.runs, options.robot_file));
    TRY(write_page(options, page));
  }
  if (!options.apply.empty()) TRY(apply_offer(options, gap::offer_of(diagnosis.diagnosis), robot));
  return Exit::ok;
}

}  // namespace joulecast::client
