#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "client/commands/accepts.h"
#include "client/commands/drive_calibration_output.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/log_progress.h"
#include "client/progress.h"
#include "dynamics/drive_model.h"
#include "energy/calibration.h"
#include "energy/power_calibration.h"
#include "plausibility/check.h"
#include "robot/robot_file.h"
#include "telemetry/impossible.h"
#include "telemetry/log_recordings.h"
#include "telemetry/recording_climb.h"
#include "telemetry/recording_set.h"

namespace joulecast::client {
namespace {

using energy::CalibrationMethod;

enum class Method { steady, whole, power };
const std::vector<std::pair<std::string, Method>> methods{
    {"steady", Method::steady}, {"whole", Method::whole}, {"power", Method::power}};

struct CalibrateDriveOptions {
  std::vector<std::string> logs;
  std::string robot_file;
  std::string out;
  std::vector<std::string> train;
  std::vector<std::string> known;
  std::optional<Method> method;
  energy::CalibrationOptions calibration;
  bool json = false;
  bool force = false;
  bool contradicted = false;
};

// True if the method uses one of `channels` for identification or test.
bool uses(Method method, const std::string& channels) {
  const auto names = [&](const char* field) { return channels.find(field) != std::string::npos; };
  return names("utime") || names("wheel_velocity") || names("battery_") ||
         (method != Method::power && (names("motor_voltage") || names("motor_current")));
}

// The error of a contradicted channel, which would be identified as a property of the robot.
Result<void> refuse_contradicted(const robot::RobotModel& robot, Method method,
                                 const std::vector<telemetry::Recording>& recordings) {
  const auto set = telemetry::make_recording_set(robot.robot_id, recordings);
  if (!set)
    return {};  // too short for the checks; the calibration reports recordings that are too short for it
  for (const plausibility::Check& check : plausibility::check_recordings(*set, robot)) {
    if (check.contradicted && uses(method, check.channel))
      return invalid(check.channel,
                     check.says +
                         " Correct the recordings, or use --contradicted to identify from them "
                         "as they are.");
  }
  return {};
}

Result<std::vector<telemetry::Recording>> load(const CalibrateDriveOptions& options,
                                               const robot::RobotModel& robot) {
  const std::string& robot_id = robot.robot_id;
  LogProgress progress("reading", options.logs);
  auto log = telemetry::read_recordings(options.logs, robot_id, progress.observer());
  if (!log) return tl::unexpected(log.error());
  std::vector<telemetry::Recording>& all = log->recordings;
  // Telemetry between missions is used only if the robot declares no missions.
  const bool declared = std::ranges::any_of(all, [](const auto& r) { return !r.implicit; });
  std::erase_if(all, [&](const auto& r) { return r.samples.empty() || (declared && r.implicit); });
  if (all.empty()) return invalid("log", "no telemetry of robot " + robot_id + " in the logs");
  for (telemetry::Recording& r : all) {
    if (!std::isfinite(r.payload_kg)) r.payload_kg = 0;
  }
  for (const telemetry::DroppedReadings& dropped : telemetry::drop_impossible(all, robot))
    fmt::print(stderr, "joulecast: {} samples count as not measured: {}\n", dropped.samples, dropped.why);
  for (const std::string& wanted : options.train) {
    if (wanted != "all" && std::ranges::none_of(all, [&](const auto& r) { return r.mission_id == wanted; }))
      return invalid("--train", "no mission " + wanted + " of robot " + robot_id + " in the logs");
  }
  return std::move(all);
}

bool has_motor_current(const std::vector<telemetry::Recording>& recordings) {
  return std::ranges::any_of(recordings, [](const telemetry::Recording& r) {
    return std::ranges::any_of(r.samples, [](const signals::Sample& s) {
      return std::isfinite(s.motor_current_a[0]) || std::isfinite(s.motor_current_a[1]);
    });
  });
}

// Fills in the calibration, by `method` and from the chosen missions.
Result<void> identify(const robot::RobotModel& robot, const CalibrateDriveOptions& options, Method method,
                      std::span<const telemetry::Recording> chosen, DriveOutcome& outcome) {
  if (method == Method::power) {
    Progress progress("identifying", "%", 100);
    auto found = energy::calibrate_from_power(robot, chosen,
                                              {options.calibration.resistance_known, progress.shares()});
    if (!found) return tl::unexpected(found.error());
    outcome.by_power = std::move(*found);
    return {};
  }
  energy::CalibrationOptions how = options.calibration;
  how.method = method == Method::whole ? CalibrationMethod::whole : CalibrationMethod::steady;
  auto found = energy::calibrate_drive(robot, chosen, how);
  if (!found) return tl::unexpected(found.error());
  outcome.by_motors = std::move(*found);
  return {};
}

// Every third mission tests what the others identify, as when the daemon adopts a model; with fewer than
// three all are needed.
bool held_out(std::size_t mission, std::size_t missions) {
  return missions >= 3 && mission % 3 == 2;
}

Result<void> account(const robot::RobotModel& robot, std::span<const energy::DriveRun> all,
                     const std::set<std::string>& train, DriveOutcome& outcome) {
  energy::MeterSettings meter;
  meter.half_window_s = energy::half_window_for(all);
  Progress progress("accounting", "missions", all.size());
  for (const energy::DriveRun& run_drive : all) {
    progress.reach(outcome.missions.size());
    const auto before = energy::metered(robot, run_drive, meter);
    if (!before) return tl::unexpected(before.error());
    const auto after = energy::metered(outcome.robot(), run_drive, meter);
    if (!after) return tl::unexpected(after.error());
    CalibratedMission c{run_drive.name, train.contains(run_drive.name), after->measured_s > 0};
    c.measured_j = c.at_battery ? after->measured_j : after->measured_motor_j[0] + after->measured_motor_j[1];
    c.before_j =
        c.at_battery ? before->modelled_j : before->modelled_motor_j[0] + before->modelled_motor_j[1];
    c.after_j = c.at_battery ? after->modelled_j : after->modelled_motor_j[0] + after->modelled_motor_j[1];
    outcome.missions.push_back(c);
  }
  return {};
}

Result<DriveOutcome> calibrate(const CalibrateDriveOptions& options) {
  const auto robot = robot::load_robot(options.robot_file);
  if (!robot) return tl::unexpected(robot.error());
  const auto recordings = load(options, *robot);
  if (!recordings) return tl::unexpected(recordings.error());
  std::set<std::string> train(options.train.begin(), options.train.end());
  const bool all_train = options.train == std::vector<std::string>{"all"};
  for (std::size_t k = 0; k < recordings->size(); ++k)
    if (all_train || (options.train.empty() && !held_out(k, recordings->size())))
      train.insert((*recordings)[k].mission_id);
  const auto drive = dynamics::drive_model(*robot);
  if (!drive) return tl::unexpected(drive.error());
  std::vector<energy::DriveRun> all;
  std::vector<telemetry::Recording> chosen;
  std::deque<std::vector<double>> climbs;
  for (const telemetry::Recording& r : *recordings) {
    climbs.push_back(telemetry::climb_of(r, drive->parameters()));
    all.push_back({r.mission_id, r.samples, r.payload_kg, climbs.back()});
    if (train.contains(r.mission_id)) chosen.push_back(r);
  }
  const Method method = options.method              ? *options.method
                        : has_motor_current(chosen) ? Method::steady
                                                    : Method::power;
  if (!options.contradicted) {
    if (const auto sound = refuse_contradicted(*robot, method, chosen); !sound)
      return tl::unexpected(sound.error());
  }
  DriveOutcome outcome;
  const auto name = std::ranges::find(methods, method, &std::pair<std::string, Method>::second);
  outcome.method = name->first;
  if (const auto done = identify(*robot, options, method, chosen, outcome); !done)
    return tl::unexpected(done.error());
  if (const auto done = account(*robot, all, train, outcome); !done) return tl::unexpected(done.error());
  return outcome;
}

Exit run_drive(CalibrateDriveOptions& options) {
  if (const auto may = may_write("--out", options.out, existing(options.force)); !may)
    return report(may.error());
  for (const std::string& known : options.known) {
    options.calibration.resistance_known |= known == "resistance";
    options.calibration.constants_known |= known == "constants";
  }
  const auto outcome = calibrate(options);
  if (!outcome) return report(outcome.error());
  // Any written file must be readable, for all measured values.
  if (const auto valid = robot::validate(outcome->robot()); !valid) return report(valid.error());
  if (!options.out.empty()) {
    const std::string text = robot::to_json_text(outcome->robot()) + "\n";
    if (const auto written = write_text_file(options.out, text, existing(options.force)); !written)
      return report(written.error());
  }
  options.json ? print_json(*outcome) : print_text(*outcome);
  return Exit::ok;
}

}  // namespace

void add_calibrate_drive(CLI::App& calibrate, Exit& exit) {
  auto options = std::make_shared<CalibrateDriveOptions>();
  auto* command = calibrate.add_subcommand(
      "drive",
      "Identify a drive from event logs, of motor voltages and currents or of battery power alone, and test "
      "it on other missions");
  command->add_option("log", options->logs, "LCM event logs")->required();
  command
      ->add_option("--robot", options->robot_file, "robot file to begin with; its robot's missions are used")
      ->required();
  command->add_option("--out", options->out, "robot file to write");
  command->add_flag("--force", options->force, force_help);
  command
      ->add_option("--train", options->train,
                   "missions to fit to, comma-separated, or all; the others test (default: two of three)")
      ->delimiter(',');
  command
      ->add_option("--method", options->method,
                   "steady: thesis (3-1) at constant speed; whole: every moving sample; power: battery power "
                   "alone, with a list of the parameters that it cannot identify (default: steady, or power "
                   "if no motor "
                   "current was recorded)")
      ->transform(one_of(methods));
  command
      ->add_option("--known", options->known, "parameters to keep from the robot file: resistance, constants")
      ->delimiter(',')
      ->check(one_of({"resistance", "constants"}));
  command
      ->add_option("--steady-acceleration", options->calibration.steady_fraction_1_s,
                   "constant speed: acceleration below this share of the top speed a second")
      ->check(positive())
      ->capture_default_str();
  command->add_flag(
      "--contradicted", options->contradicted,
      "identify also from channels that joulecast check finds contradicted, for instance because of "
      "a mismatched robot file");
  command->add_flag("--json", options->json, "print the result as JSON");
  command->callback([options, &exit] { exit = run_drive(*options); });
}

}  // namespace joulecast::client
