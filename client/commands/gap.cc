#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/try.h"
#include "client/commands/accepts.h"
#include "client/commands/gap_compare.h"
#include "client/commands/gap_missions.h"
#include "client/commands/gap_output.h"
#include "client/commands/gap_server.h"
#include "client/commands/gap_test.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/log_progress.h"
#include "client/progress.h"
#include "gap/diagnose/recordings.h"
#include "gap/verdict/diagnosis_json.h"
#include "gap/verdict/offer.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

struct GapOptions {
  std::vector<std::string> logs;
  std::string robot_file;
  std::string robot_id;
  std::string apply;
  std::string report;
  std::string compare_by;
  std::vector<std::string> test;
  std::string server;
  std::size_t max_missions = 200;
  std::vector<std::string> effect;
  bool adopt = false;
  bool force = false;
  bool json = false;
  GapMissionsOptions missions;
};

// The diagnosis of logs and its test on other missions.
struct Judged {
  gap::Diagnosis diagnosis;
  Result<robot::RobotModel>
      extended;  // the robot file with the effects found, or the reason against adoption
  std::optional<GapTest> test;
};

Result<Judged> judge_recordings(const GapOptions& options, const telemetry::RecordingSet& recordings,
                                const robot::RobotModel& robot) {
  Result<gap::Diagnosis> diagnosis = [&] {
    Progress progress("diagnosing", "%", 100);
    gap::DiagnosisSettings settings;
    settings.progress = progress.shares();
    return gap::diagnose(recordings, robot, settings);
  }();
  if (!diagnosis) return tl::unexpected(diagnosis.error());
  const gap::Offer offer = gap::offer_of(*diagnosis);
  Judged judged{std::move(*diagnosis), gap::take(offer, robot, {options.effect, options.force}),
                std::nullopt};
  if (options.test.empty()) return judged;
  // The test does not require that the effects can be adopted.
  const Result<robot::RobotModel> tried =
      offer.effects.empty() ? robot : gap::take(offer, robot, {options.effect, true});
  if (!tried) return tl::unexpected(of_option(tried.error(), "--test"));
  TRY_ASSIGN(auto tested,
             test_on_other_missions(options.test, options.robot_id, recordings.missions, robot, *tried));
  judged.test = std::move(tested);
  return judged;
}

Exit apply(const GapOptions& options, const Judged& judged) {
  if (!judged.extended) return report(of_option(judged.extended.error(), "--apply"));
  if (const std::string objection = judged.test ? judged.test->objection() : "";
      !objection.empty() && !options.force)
    return report({Fault::conflict, "--apply", objection + "; --force writes it all the same"});
  return write_robot(*judged.extended, options.apply, options.force);
}

Exit gap_of_logs(const GapOptions& options, const robot::RobotModel& robot) {
  const auto recordings = [&] {
    LogProgress progress("reading", options.logs);
    return telemetry::load_recordings(
        options.logs, options.robot_id.empty() ? robot.robot_id : options.robot_id, progress.observer());
  }();
  if (!recordings) return report(recordings.error());
  const report::ReportOrigin origin = report_origin(options.logs, options.robot_file);
  if (!options.compare_by.empty())
    return gap_between_groups(*recordings, robot,
                              {options.compare_by, options.json, options.report, options.force}, origin);
  const Result<Judged> judged = judge_recordings(options, *recordings, robot);
  if (!judged) return report(judged.error());
  nlohmann::ordered_json document = gap::diagnosis_to_json(judged->diagnosis);
  if (options.json) {
    if (judged->test) document["back_test"] = to_json(*judged->test);
    std::printf("%s\n", document.dump(2).c_str());
  } else {
    print_diagnosis(document);
    if (judged->test) print(*judged->test);
  }
  if (!options.report.empty()) {
    const auto page = report::report_html(document, robot, origin);
    if (const auto written = write_text_file(options.report, page, existing(options.force)); !written)
      return report(written.error());
  }
  return options.apply.empty() ? Exit::ok : apply(options, *judged);
}

Exit run_gap(const GapOptions& options) {
  for (const auto& [option, file] : {std::pair{"--report", &options.report}, {"--apply", &options.apply}})
    if (const auto may = may_write(option, *file, existing(options.force)); !may) return report(may.error());
  if (!options.server.empty()) {
    return gap_from_server({options.server,
                            options.robot_id,
                            options.max_missions,
                            options.report,
                            options.apply,
                            {options.effect, options.force},
                            options.json,
                            options.adopt});
  }
  const auto robot = robot::load_robot(options.robot_file);
  if (!robot) return report(robot.error());
  if (options.missions.runs.empty()) return gap_of_logs(options, *robot);
  GapMissionsOptions missions = options.missions;
  missions.robot_file = options.robot_file;
  missions.json = options.json;
  missions.report = options.report;
  missions.apply = options.apply;
  missions.compare_by = options.compare_by;
  missions.effect = options.effect;
  missions.force = options.force;
  return gap_from_missions(missions, *robot);
}

}  // namespace

void add_gap(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<GapOptions>();
  auto* command = program.add_subcommand(
      "gap",
      "Diagnose the gap between measured power and the robot's model: where it occurs, the effects that "
      "cause it and the unexplained rest");
  auto* logs = command->add_option("log", options->logs, "LCM event logs of one robot");
  auto* missions = command
                       ->add_option("--missions", options->missions.runs,
                                    "instead of logs: CSV tables of runs with only their energies, in the "
                                    "columns below")
                       ->excludes(logs);
  command
      ->add_flag("--robot-model", options->missions.robot_model,
                 "with --missions: diagnose the robot file also if the table contains a model's energies")
      ->needs(missions);
  auto* robot = command->add_option("--robot", options->robot_file, "robot file: the model");
  command->add_option("--robot-id", options->robot_id,
                      "robot of the logs, if its id differs from that of the robot file");
  command->add_flag("--json", options->json, "print the diagnosis as JSON");
  command->add_option("--report", options->report,
                      "write the diagnosis as one HTML page with its maps and plots");
  command->add_option(
      "--compare-by", options->compare_by,
      "instead of one diagnosis, compare groups of missions by: 'prefix', the mission id up to "
      "its first '-'; 'suffix', the mission id from its last '_'; or a label, such as surface "
      "for the covariates surface=...; for runs, a label or 'table'");
  command->add_option(
      "--apply", options->apply,
      "write the robot file with the effects found, or a corrected one if it belongs to another robot; "
      "rejected, with the reason, if the diagnosis does not support it");
  command->add_option("--effect", options->effect,
                      "with --apply or --adopt: the one to take of effects that cannot be distinguished");
  command
      ->add_option(
          "--test", options->test,
          "logs of other missions: replay them with and without the effects found, and compare with a plain "
          "regression on the missions of the diagnosis; --apply is refused where they show no improvement or "
          "the regression predicts them better")
      ->excludes(missions);
  auto* server = command
                     ->add_option("--server", options->server,
                                  "daemon that diagnoses its own history of --robot-id, instead of logs")
                     ->excludes(logs)
                     ->excludes(missions)
                     ->excludes(robot);
  command
      ->add_option("--max-missions", options->max_missions,
                   "with --server: number of missions to diagnose, newest first")
      ->needs(server)
      ->check(between(1, 1000));
  command
      ->add_flag("--adopt", options->adopt,
                 "with --server: adopt the effects found, after the daemon's back-test")
      ->needs(server);
  command->add_flag("--force", options->force,
                    "adopt or apply in spite of the diagnosis's refusal or a back-test without improvement; "
                    "overwrite existing files");
  command->footer(run_columns_help());
  command->callback([options, command, logs, missions, robot, server, &exit] {
    if (!command->get_subcommands().empty()) return;
    // Not required() by the parser, which would require them with the subcommands too.
    if (!server->empty() && options->robot_id.empty()) throw CLI::RequiredError("--robot-id");
    if (logs->empty() && missions->empty() && server->empty())
      throw CLI::RequiredError("log, --missions or --server");
    if (robot->empty() && server->empty()) throw CLI::RequiredError(robot->get_name());
    exit = run_gap(*options);
  });
}

}  // namespace joulecast::client
