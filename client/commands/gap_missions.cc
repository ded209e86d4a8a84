#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/try.h"
#include "client/commands/gap_output.h"
#include "client/files.h"
#include "client/progress.h"
#include "client/wrapped.h"
#include "gap/groups/comparison_json.h"
#include "gap/runs/runs_json.h"

namespace joulecast::client {
namespace {

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

Result<Exit> compare_and_print(const std::function<Result<gap::Comparison>(const gap::Progress&)>& compare,
                               const robot::RobotModel& robot, const GapOptions& options,
                               const report::ReportOrigin& origin) {
  TRY_ASSIGN(const auto comparison, with_progress("comparing", compare));
  const nlohmann::ordered_json document = gap::comparison_to_json(comparison);
  show_diagnosis(options, document);
  TRY(write_page(options, document, robot, origin));
  return Exit::ok;
}

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
  TRY_ASSIGN(const auto diagnosis, with_progress("diagnosing", [&](const gap::Progress& progress) {
               return gap::diagnose_runs(runs, robot, options.robot_model, progress);
             }));
  const nlohmann::ordered_json document = gap::runs_to_json(diagnosis);
  show_diagnosis(options, document);
  TRY(write_page(options, document, robot, report_origin(options.runs, options.robot_file)));
  if (!options.apply.empty()) TRY(apply_offer(options, gap::offer_of(diagnosis.diagnosis), robot));
  return Exit::ok;
}

}  // namespace joulecast::client
