#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "client/commands/listen.h"
#include "client/commands/outcome.h"
#include "client/commands/print.h"
#include "client/progress.h"
#include "gap/groups/compare.h"
#include "gap/verdict/offer.h"
#include "report/report.h"
#include "robot/robot_model.h"

// The parts of the command gap.
namespace joulecast::client {

struct GapOptions {
  std::vector<std::string> logs;
  std::vector<std::string> runs;  // CSV files, instead of logs
  std::vector<std::string> test;  // logs of other missions
  std::string robot_file, robot_id, server;
  std::string compare_by;  // groups to compare: "prefix" or "suffix" of the missions' ids, or a label
  std::string report;      // HTML file to write; empty: none
  std::string apply;       // robot file to write; empty: none
  std::string unit = energy_units.front();
  std::size_t max_missions = 200;
  std::vector<std::string> effect;  // to take of those that are not distinguished
  bool robot_model = false;         // diagnose the robot file, not the energies of a model in a table of runs
  bool adopt = false;               // in the daemon, after a back-test
  bool force = false;               // write in spite of the diagnosis's refusal, and over existing files
  bool json = false;

  gap::Choice choice() const { return {effect, force}; }
};

// Diagnoses the gap from energies of whole runs.
[[nodiscard]] Result<Exit> gap_from_missions(const GapOptions& options, const robot::RobotModel& robot);

// The columns of a table of runs, for the help.
[[nodiscard]] std::string run_columns_help();

// Starts a diagnosis of a daemon's own history of a robot, follows the job and prints its result. An
// interrupt cancels the job.
[[nodiscard]] Result<Exit> gap_from_server(const GapOptions& options);

// Makes a comparison, prints it and writes its page.
[[nodiscard]] Result<Exit> compare_and_print(
    const std::function<Result<gap::Comparison>(const gap::Progress&)>& compare,
    const robot::RobotModel& robot, const GapOptions& options, const report::ReportOrigin& origin);

// Prints the document of a diagnosis, with --json as it is.
void show_diagnosis(const GapOptions& options, const nlohmann::ordered_json& document);

// Work with a progress line in per cent.
template <class Work>
auto with_progress(const char* activity, Work work) {
  Progress progress(activity, "%", 100);
  return work(progress.shares());
}

// Writes the page of --report, if one is requested.
[[nodiscard]] Result<void> write_page(const GapOptions& options, const nlohmann::ordered_json& document,
                                      const robot::RobotModel& robot, const report::ReportOrigin& origin);
// Writes the robot file of --apply with the effects found, or returns the refusal.
[[nodiscard]] Result<void> apply_offer(const GapOptions& options, const gap::Offer& offer,
                                       const robot::RobotModel& robot);

// Prints the JSON of a diagnosis, made offline or by a daemon, or of a comparison.
void print_diagnosis(const nlohmann::json& diagnosis, const std::string& unit = energy_units.front());

// `error` of an adoption as an error of `option`, which requested it; of --effect for a choice among effects.
Error of_option(Error error, const std::string& option);

// The origin of a report: names of files without their folders, and the present time.
report::ReportOrigin report_origin(const std::vector<std::string>& sources, const std::string& robot_file);

// {"channels": [{"channel", "robot_id", "messages", "rate_hz", ..., "fields": [...], "faults": {...}}]};
// numbers that are not available are null.
[[nodiscard]] nlohmann::json to_json(const telemetry::ChannelWatch& watch);
// The same with {"dropped_datagrams": {...}}.
[[nodiscard]] nlohmann::json to_json(const Listened& listened);

}  // namespace joulecast::client
