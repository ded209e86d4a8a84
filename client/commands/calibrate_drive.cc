#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "base/json_number.h"
#include "client/commands/accepts.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"
#include "dynamics/drive_model.h"
#include "energy/calibration.h"
#include "robot/robot_file.h"
#include "telemetry/log_recordings.h"
#include "telemetry/recording_climb.h"

namespace joulecast::client {
namespace {

using energy::CalibrationMethod;

struct Options {
  std::vector<std::string> logs;
  std::string robot_file;
  std::string out;
  std::vector<std::string> train;
  std::vector<std::string> known;
  energy::CalibrationOptions calibration;
  bool json = false;
  bool force = false;
};

const std::vector<std::pair<std::string, CalibrationMethod>> methods{{"steady", CalibrationMethod::steady},
                                                                     {"whole", CalibrationMethod::whole}};

// One mission's energy, measured and by both models, at the motors or, where measured, at the battery.
struct Comparison {
  std::string mission_id;
  bool trained_on = false;
  bool at_battery = false;
  double measured_j = 0;
  double before_j = 0;  // by the robot file as given
  double after_j = 0;   // by the calibrated one

  double error_before() const { return before_j / measured_j - 1; }
  double error_after() const { return after_j / measured_j - 1; }
};

struct Outcome {
  energy::DriveCalibration calibration;
  std::vector<Comparison> missions;
};

Result<std::vector<telemetry::Recording>> load(const Options& options, const std::string& robot_id) {
  auto log = telemetry::read_recordings(options.logs, robot_id);
  if (!log) return tl::unexpected(log.error());
  std::vector<telemetry::Recording>& all = log->recordings;
  // What a robot does between its missions counts only where it declares none.
  const bool declared = std::ranges::any_of(all, [](const auto& r) { return !r.implicit; });
  std::erase_if(all, [&](const auto& r) { return r.samples.empty() || (declared && r.implicit); });
  if (all.empty()) return invalid("log", "no telemetry of robot " + robot_id + " in the logs");
  for (telemetry::Recording& r : all) {
    if (!std::isfinite(r.payload_kg)) r.payload_kg = 0;
  }
  for (const std::string& wanted : options.train) {
    if (std::ranges::none_of(all, [&](const auto& r) { return r.mission_id == wanted; }))
      return invalid("--train", "no mission " + wanted + " of robot " + robot_id + " in the logs");
  }
  return std::move(all);
}

Result<Outcome> calibrate(const Options& options) {
  const auto robot = robot::load_robot(options.robot_file);
  if (!robot) return tl::unexpected(robot.error());
  const auto recordings = load(options, robot->robot_id);
  if (!recordings) return tl::unexpected(recordings.error());
  const std::set<std::string> train(options.train.begin(), options.train.end());
  const auto drive = dynamics::drive_model(*robot);
  if (!drive) return tl::unexpected(drive.error());
  std::vector<energy::DriveRun> all, chosen;
  std::deque<std::vector<double>> climbs;
  for (const telemetry::Recording& r : *recordings) {
    climbs.push_back(telemetry::climb_of(r, drive->parameters()));
    all.push_back({r.mission_id, r.samples, r.payload_kg, climbs.back()});
    if (train.empty() || train.contains(r.mission_id)) chosen.push_back(all.back());
  }
  auto calibration = energy::calibrate_drive(*robot, chosen, options.calibration);
  if (!calibration) return tl::unexpected(calibration.error());
  Outcome outcome{std::move(*calibration), {}};
  energy::MeterSettings meter;
  meter.half_window_s = energy::half_window_for(all);
  Progress progress("accounting", "missions", all.size());
  for (const energy::DriveRun& run : all) {
    progress.reach(outcome.missions.size());
    const auto before = energy::metered(*robot, run, meter);
    if (!before) return tl::unexpected(before.error());
    const auto after = energy::metered(outcome.calibration.robot, run, meter);
    if (!after) return tl::unexpected(after.error());
    Comparison c{run.name, train.empty() || train.contains(run.name), after->measured_s > 0};
    c.measured_j = c.at_battery ? after->measured_j : after->measured_motor_j[0] + after->measured_motor_j[1];
    c.before_j =
        c.at_battery ? before->modelled_j : before->modelled_motor_j[0] + before->modelled_motor_j[1];
    c.after_j = c.at_battery ? after->modelled_j : after->modelled_motor_j[0] + after->modelled_motor_j[1];
    outcome.missions.push_back(c);
  }
  return outcome;
}

void print_json(const Options& options, const Outcome& outcome) {
  const energy::DriveCalibration& fit = outcome.calibration;
  nlohmann::json document{
      {"robot", robot::robot_to_json(fit.robot)},
      {"method", options.calibration.method == CalibrationMethod::steady ? "steady" : "whole"},
      {"blocks", fit.blocks},
      {"samples", fit.samples},
      {"slowest_rad_s", fit.slowest_rad_s},
      {"fastest_rad_s", fit.fastest_rad_s},
      {"voltage_rms_v", json_number(fit.voltage_rms_v)},
      {"torque_rms_nm", json_number(fit.torque_rms_nm)},
      {"parameters", nlohmann::json::array()},
      {"missions", nlohmann::json::array()}};
  for (const energy::ParameterEstimate& e : fit.estimates)
    document["parameters"].push_back({{"name", e.name},
                                      {"unit", e.unit},
                                      {"value", e.value},
                                      {"standard_error", e.fitted ? json_number(e.standard_error) : nullptr},
                                      {"fitted", e.fitted},
                                      {"note", e.note}});
  for (const Comparison& c : outcome.missions)
    document["missions"].push_back({{"mission_id", c.mission_id},
                                    {"trained_on", c.trained_on},
                                    {"measured_at", c.at_battery ? "battery" : "motors"},
                                    {"measured_j", c.measured_j},
                                    {"file_j", c.before_j},
                                    {"calibrated_j", c.after_j},
                                    {"file_error", json_number(c.error_before())},
                                    {"calibrated_error", json_number(c.error_after())}});
  std::puts(document.dump(2).c_str());
}

void print_text(const Outcome& outcome) {
  const energy::DriveCalibration& fit = outcome.calibration;
  for (const energy::ParameterEstimate& e : fit.estimates) {
    fmt::print("{:<26} {:>12.5g}", e.name, e.value);
    e.fitted ? fmt::print(" +- {:<10.3g}", e.standard_error) : fmt::print(" {:<13}", "(held)");
    fmt::print(" {:<10} {}\n", e.unit, e.note);
  }
  fmt::print(
      "from {} stretches, {} samples, wheels at {:.2f} to {:.2f} rad/s; residuals {:.3g} V, {:.3g} N m "
      "rms\n\n",
      fit.blocks, fit.samples, fit.slowest_rad_s, fit.fastest_rad_s, fit.voltage_rms_v, fit.torque_rms_nm);
  fmt::print("{:<32} {:<8} {:<8} {:>12} {:>12} {:>9} {:>12} {:>9}\n", "mission", "used", "at", "measured J",
             "file J", "error", "fitted J", "error");
  double unused = 0, total = 0, error = 0;
  for (const Comparison& c : outcome.missions) {
    fmt::print("{:<32} {:<8} {:<8} {:>12.2f} {:>12.2f} {:>+8.1f}% {:>12.2f} {:>+8.1f}%\n", c.mission_id,
               c.trained_on ? "to fit" : "to test", c.at_battery ? "battery" : "motors", c.measured_j,
               c.before_j, 1e2 * c.error_before(), c.after_j, 1e2 * c.error_after());
    if (c.trained_on) continue;
    unused += 1;
    total += c.measured_j;
    error += std::fabs(c.after_j - c.measured_j);
  }
  if (unused > 0)
    fmt::print("on the {:.0f} missions not used: {:.1f} % of their energy missed\n", unused,
               1e2 * error / total);
}

Exit run(Options& options) {
  if (const auto may = may_write("--out", options.out, existing(options.force)); !may)
    return report(may.error());
  for (const std::string& known : options.known) {
    options.calibration.resistance_known |= known == "resistance";
    options.calibration.constants_known |= known == "constants";
  }
  const auto outcome = calibrate(options);
  if (!outcome) return report(outcome.error());
  // What is written must be readable again, whatever was measured.
  if (const auto valid = robot::validate(outcome->calibration.robot); !valid) return report(valid.error());
  if (!options.out.empty()) {
    const std::string text = robot::to_json_text(outcome->calibration.robot) + "\n";
    if (const auto written = write_text_file(options.out, text, existing(options.force)); !written)
      return report(written.error());
  }
  options.json ? print_json(options, *outcome) : print_text(*outcome);
  return Exit::ok;
}

}  // namespace

void add_calibrate_drive(CLI::App& calibrate, Exit& exit) {
  auto options = std::make_shared<Options>();
  auto* command = calibrate.add_subcommand(
      "drive",
      "Identify a drive from event logs with motor voltages and currents, and test it on other missions");
  command->add_option("log", options->logs, "LCM event logs")->required();
  command->add_option("--robot", options->robot_file, "robot file to begin with; says whose missions count")
      ->required();
  command->add_option("--out", options->out, "robot file to write");
  command->add_flag("--force", options->force, force_help);
  command
      ->add_option("--train", options->train,
                   "missions to fit to, comma-separated; the others test (default: all)")
      ->delimiter(',');
  command
      ->add_option("--method", options->calibration.method,
                   "steady: thesis (3-1) at constant speed; whole: every moving sample")
      ->transform(one_of(methods))
      ->default_str("steady");
  command->add_option("--known", options->known, "what the robot file already knows: resistance, constants")
      ->delimiter(',')
      ->check(one_of({"resistance", "constants"}));
  command
      ->add_option("--steady-acceleration", options->calibration.steady_fraction_1_s,
                   "constant speed: acceleration below this share of the top speed a second")
      ->check(positive())
      ->capture_default_str();
  command->add_flag("--json", options->json, "print the result as JSON");
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client
