#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/json_number.h"
#include "robot/robot_file.h"
#include "telemetry/recording_set.h"
#include "tests/study/corrections/corrections.h"
#include "tests/study/study_commands.h"

namespace joulecast::client {
namespace {

struct CorrectionsOptions {
  std::vector<std::string> logs;
  std::string robot_file;
  bool all = false;
};

Exit run_corrections(const CorrectionsOptions& options) {
  const auto robot = robot::load_robot(options.robot_file);
  if (!robot) return report(robot.error());
  const auto recordings = telemetry::load_recordings(options.logs, robot->robot_id);
  if (!recordings) return report(recordings.error());
  const gap::CorrectedReadings corrected = gap::correct_readings(*recordings, *robot, !options.all);
  nlohmann::ordered_json found = nlohmann::ordered_json::array();
  for (const gap::ReadingCorrection& c : corrected.found) {
    found.push_back({{"channel", c.channel},
                     {"kind", c.kind},
                     {"factor", json_number(c.factor)},
                     {"sd", json_number(c.deviation)},
                     {"delay_s", c.delay_s},
                     {"probability", c.probability},
                     {"contradicted", c.contradicted},
                     {"applied", c.applied},
                     {"says", c.says}});
  }
  const nlohmann::ordered_json answer{
      {"corrections", std::move(found)}, {"hypotheses", corrected.hypotheses}, {"fitted", corrected.fitted}};
  std::printf("%s\n", answer.dump().c_str());
  return Exit::ok;
}

}  // namespace

void add_corrections(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<CorrectionsOptions>();
  auto* command = program.add_subcommand(
      "corrections",
      "Find errors of units, signs and channels in event logs and print them as one line of JSON");
  command->add_option("logs", options->logs, "event logs of one robot")->required()->type_name("LOG");
  command->add_option("--robot", options->robot_file, "robot file")->required()->type_name("FILE");
  command->add_flag("--all", options->all, "fit every hypothesis instead of pruning");
  command->callback([options, &exit] { exit = run_corrections(*options); });
}

}  // namespace joulecast::client
