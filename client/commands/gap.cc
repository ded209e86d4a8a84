#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/commands/gap_compare.h"
#include "client/commands/gap_missions.h"
#include "client/commands/gap_output.h"
#include "client/commands/gap_server.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"
#include "energy/back_test.h"
#include "energy/back_test_json.h"
#include "gap/adopt.h"
#include "gap/diagnosis.h"
#include "gap/diagnosis_json.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

struct Options {
  std::vector<std::string> logs;
  std::string robot_file;
  std::string robot_id;
  std::string apply;
  std::string report;
  std::string compare_by;
  std::vector<std::string> test;
  std::string server;
  std::size_t max_missions = 200;
  bool adopt = false;
  bool force = false;
  bool json = false;
  GapMissionsOptions missions;
};

void print(const energy::BackTest& test) {
  std::printf("%-24s %12s %14s %14s\n", "tested on mission", "measured J", "error before", "error after");
  for (const energy::RunComparison& run : test.runs)
    std::printf("%-24s %12.2f %12.2f %% %12.2f %%\n", run.name.c_str(), run.measured_j,
                100 * run.before.relative, 100 * run.after.relative);
  const auto fall = [](const char* what, double before, double after, const std::array<double, 2>& interval) {
    std::printf("%s %.2f %% -> %.2f %%, falls by %.2f %% [%.2f, %.2f]\n", what, 100 * before, 100 * after,
                100 * (before - after), 100 * interval[0], 100 * interval[1]);
  };
  fall("energy error", test.error_before, test.error_after, test.improvement_interval);
  fall("power gap", test.power_gap_before, test.power_gap_after, test.power_gap_fall_interval);
  std::puts(test.improves() ? "it improves" : "no improvement is shown");
}

// The robot file and the one with the effects found, on missions of other logs.
Result<energy::BackTest> test_of(const Options& options, const robot::RobotModel& robot,
                                 const robot::RobotModel& extended) {
  const auto recordings = telemetry::load_recordings(options.test, options.robot_id);
  if (!recordings) return tl::unexpected(recordings.error());
  std::vector<energy::DriveRun> runs;
  for (const telemetry::Recording& mission : recordings->missions)
    runs.push_back(
        {mission.mission_id, mission.samples, std::isfinite(mission.payload_kg) ? mission.payload_kg : 0});
  return energy::back_test(runs, robot, extended);
}

Exit run(const Options& options) {
  if (!options.server.empty()) {
    return gap_from_server({options.server, options.robot_id, options.max_missions, options.report,
                            options.apply, options.json, options.adopt, options.force});
  }
  const auto robot = robot::load_robot(options.robot_file);
  if (!robot) return report(robot.error());
  if (!options.missions.runs.empty()) {
    GapMissionsOptions missions = options.missions;
    missions.robot_file = options.robot_file;
    missions.json = options.json;
    missions.report = options.report;
    missions.apply = options.apply;
    return gap_from_missions(missions, *robot);
  }
  const auto recordings =
      telemetry::load_recordings(options.logs, options.robot_id.empty() ? robot->robot_id : options.robot_id);
  if (!recordings) return report(recordings.error());
  if (!options.compare_by.empty())
    return gap_between_groups(*recordings, *robot, options.compare_by, options.json, options.report,
                              report_origin(options.logs, options.robot_file));
  const auto diagnosis = [&] {
    Progress progress("diagnosing", "%", 100);
    gap::DiagnosisSettings settings;
    settings.progress = progress.shares();
    return gap::diagnose(*recordings, *robot, settings);
  }();
  if (!diagnosis) return report(diagnosis.error());
  const auto extended = gap::with_effects(*robot, diagnosis->adoptable);
  if (!extended) return report(extended.error());
  std::optional<energy::BackTest> test;
  if (!options.test.empty()) {
    auto tested = test_of(options, *robot, *extended);
    if (!tested) return report(tested.error());
    test = std::move(*tested);
  }
  nlohmann::json document = gap::diagnosis_to_json(*diagnosis);
  if (options.json) {
    if (test) document["back_test"] = energy::back_test_to_json(*test);
    std::printf("%s\n", document.dump(2).c_str());
  } else {
    print_diagnosis(document);
    if (test) print(*test);
  }
  if (!options.report.empty()) {
    const auto page =
        gap::report_html(*diagnosis, *recordings, *robot, report_origin(options.logs, options.robot_file));
    if (const auto written = write_file(options.report, page); !written) return report(written.error());
  }
  if (options.apply.empty()) return Exit::ok;
  if (test && !test->improves() && !options.force)
    return report(
        {Fault::infeasible, "--apply", "the back-test shows no improvement; --force writes it all the same"});
  return write_robot(*extended, options.apply);
}

}  // namespace

void add_gap(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<Options>();
  auto* command = program.add_subcommand(
      "gap",
      "Say where measured power departs from the robot's model, which effects cause it and what remains");
  auto* logs = command->add_option("log", options->logs, "LCM event logs of one robot");
  auto* missions = command
                       ->add_option("--missions", options->missions.runs,
                                    "instead of logs: CSV tables of runs of which only energies are known, "
                                    "with the columns below")
                       ->excludes(logs);
  command
      ->add_flag("--robot-model", options->missions.robot_model,
                 "with --missions: judge the robot file even where the table brings a model's energies")
      ->needs(missions);
  auto* robot = command->add_option("--robot", options->robot_file, "robot file: the model");
  command->add_option("--robot-id", options->robot_id,
                      "which robot of the logs, where it is not the robot file's own");
  command->add_flag("--json", options->json, "print the diagnosis as JSON");
  command->add_option("--report", options->report,
                      "write the diagnosis as one HTML page with its maps and plots");
  command
      ->add_option(
          "--compare-by", options->compare_by,
          "instead of one diagnosis say what changes between groups of missions: 'prefix' of the mission id, up to its "
          "first '-'; 'suffix', from its last '_'; or a label, as surface of the covariates surface=...; of runs a "
          "label or 'table'");
  command->add_option("--apply", options->apply, "write the robot file with the effects found");
  command
      ->add_option(
          "--test", options->test,
          "logs of other missions: replay them with and without the effects found; --apply is refused "
          "where they show no improvement")
      ->excludes(missions);
  auto* server = command
                     ->add_option("--server", options->server,
                                  "daemon that diagnoses its own history of --robot-id, instead of logs")
                     ->excludes(logs)
                     ->excludes(missions)
                     ->excludes(robot);
  command->add_option("--max-missions", options->max_missions, "with --server: newest missions to judge by")
      ->needs(server)
      ->check(CLI::Range(1, 1000));
  command
      ->add_flag("--adopt", options->adopt,
                 "with --server: adopt what is found, after the daemon's back-test")
      ->needs(server);
  command->add_flag("--force", options->force, "adopt or apply even when the back-test shows no improvement");
  command->footer(run_columns_help());
  add_gap_trial(*command, exit);
  command->callback([options, command, logs, missions, robot, server, &exit] {
    if (!command->get_subcommands().empty()) return;
    // Not required() by the parser, which would ask for them of the subcommands too.
    if (!server->empty() && options->robot_id.empty()) throw CLI::RequiredError("--robot-id");
    if (logs->empty() && missions->empty() && server->empty())
      throw CLI::RequiredError("log, --missions or --server");
    if (robot->empty() && server->empty()) throw CLI::RequiredError(robot->get_name());
    options->missions.compare_by = options->compare_by;
    options->missions.force = options->force;
    exit = run(*options);
  });
}

}  // namespace joulecast::client
