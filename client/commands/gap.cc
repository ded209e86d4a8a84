#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/gap_compare.h"
#include "client/commands/gap_missions.h"
#include "client/commands/gap_output.h"
#include "client/commands/table.h"
#include "client/files.h"
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
  bool json = false;
  GapMissionsOptions missions;
};

void print(const gap::Diagnosis& d) {
  std::printf("%s: %zu missions, %zu samples%s\n", d.robot_id.c_str(), d.missions, d.samples,
              d.motor_channels ? "" : " (no motor channels: judged from battery power and motion alone)");
  if (d.power == gap::PowerSource::none) {
    std::printf("gap: no power was recorded; judged from torques\n");
  } else {
    std::printf(
        "gap: energy %+.1f %%, absolute power %.1f %% (noise floor %.1f %%)%s\n", 100 * d.energy_relative,
        100 * d.power_absolute_relative, 100 * d.noise_floor,
        d.power == gap::PowerSource::motors ? ", of the motors' power with the file's idle power" : "");
  }
  const auto verdict = gap::name_of(d.verdict);
  std::printf("verdict: %.*s (probability %.2f)\n", static_cast<int>(verdict.size()), verdict.data(),
              d.verdict_probability);
  for (const auto& e : d.effects) print_effect(e);
  if (!d.outside.channel.empty()) {
    std::printf("  outside the catalogue: in %s, follows %s (probability %.2f)\n", d.outside.channel.c_str(),
                d.outside.follows.c_str(), d.outside.probability);
  }
  if (d.shrinkage) {
    std::printf("held-out gap: %.1f %% -> %.1f %%, shrinks by %.0f %% [%.0f, %.0f]",
                100 * d.shrinkage->before, 100 * d.shrinkage->after, 100 * d.shrinkage->fraction,
                100 * d.shrinkage->interval[0], 100 * d.shrinkage->interval[1]);
    if (std::isfinite(d.shrinkage->remaining_over_noise_floor))
      std::printf("; remaining is %.1f noise floors", d.shrinkage->remaining_over_noise_floor);
    std::printf("\n");
    if (d.shrinkage->interval[1] < 0)
      std::printf("  it grows on missions left out: these effects are no explanation\n");
    else if (d.shrinkage->interval[0] < 0)
      std::printf("  that the effects help on missions left out is not sure\n");
  }
  if (!d.where.empty()) std::printf("where:\n");
  for (std::size_t k = 0; k < d.where.size() && k < 8; ++k) {
    const auto& w = d.where[k];
    const std::string range =
        w.label.empty() ? std::to_string(w.from) + " to " + std::to_string(w.to) : w.label;
    std::printf("  %s, %s %s: %+.0f %% of the gap [%.0f, %.0f]\n", w.channel.c_str(), w.variable.c_str(),
                range.c_str(), 100 * w.share, 100 * w.interval[0], 100 * w.interval[1]);
  }
  for (const auto& n : d.next_drive) {
    std::printf("next drive, to tell %s: %s (log evidence +%.1f)\n", n.separates.c_str(), n.manoeuvre.c_str(),
                n.expected_log_evidence);
  }
}

Exit run(const Options& options) {
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
  const auto recordings = gap::load_recordings(options.logs, options.robot_id);
  if (!recordings) return report(recordings.error());
  if (!options.compare_by.empty())
    return gap_between_groups(*recordings, *robot, options.compare_by, options.json, options.report,
                              report_origin(options.logs, options.robot_file));
  const auto diagnosis = gap::diagnose(*recordings, *robot);
  if (!diagnosis) return report(diagnosis.error());
  if (options.json) {
    std::printf("%s\n", gap::to_json_text(*diagnosis).c_str());
  } else {
    print(*diagnosis);
  }
  if (!options.report.empty()) {
    const auto page =
        gap::report_html(*diagnosis, *recordings, *robot, report_origin(options.logs, options.robot_file));
    if (const auto written = write_file(options.report, page); !written) return report(written.error());
  }
  return options.apply.empty() ? Exit::ok : write_adopted(diagnosis->adoptable, *robot, options.apply);
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
                                    "instead of logs a CSV table of runs of which only energies are known. "
                                    "Its columns: " +
                                        run_columns_help())
                       ->excludes(logs);
  command
      ->add_flag("--robot-model", options->missions.robot_model,
                 "with --missions: judge the robot file even where the table brings a model's energies")
      ->needs(missions);
  auto* robot = command->add_option("--robot", options->robot_file, "robot file: the model");
  command->add_option("--robot-id", options->robot_id, "which robot, where the logs hold several");
  command->add_flag("--json", options->json, "print the diagnosis as JSON");
  command->add_option("--report", options->report,
                      "write the diagnosis as one HTML page with its maps and plots");
  command
      ->add_option(
          "--compare-by", options->compare_by,
          "instead of one diagnosis say what changes between groups of missions: those of one prefix of "
          "the mission id, up to its first '-', or of one suffix, from its last '_'")
      ->check(CLI::IsMember({"prefix", "suffix"}))
      ->excludes(missions);
  command->add_option("--apply", options->apply, "write the robot file with the effects found");
  add_gap_trial(*command, exit);
  command->callback([options, command, logs, missions, robot, &exit] {
    if (!command->get_subcommands().empty()) return;
    // Not required() by the parser, which would ask for them of the subcommands too.
    if (logs->empty() && missions->empty()) throw CLI::RequiredError("log or --missions");
    if (robot->empty()) throw CLI::RequiredError(robot->get_name());
    exit = run(*options);
  });
}

}  // namespace joulecast::client
