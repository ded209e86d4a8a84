#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/server_answer.h"
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
#include "telemetry/recording.h"

namespace joulecast::energy {
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DriveCalibration, blocks, windows, slowest_rad_s, fastest_rad_s,
                                   voltage_rms_v, torque_rms_nm, electrical_delay_s)
}  // namespace joulecast::energy

namespace joulecast::client {
namespace {

using energy::CalibrationMethod;

// --method
constexpr const char *by_steady = "steady", *by_whole = "whole", *by_power = "power";

struct CalibrateDriveOptions {
  std::vector<std::string> logs, train, known;
  std::string robot_file, out, method, unit = energy_units.front();
  double steady_fraction_1_s = energy::CalibrationOptions{}.steady_fraction_1_s;
  bool json = false, force = false, contradicted = false;
};

// One mission's energy, measured and by both models, at the motors or, where measured, at the battery.
struct CalibratedMission {
  std::string mission_id;
  bool trained_on = false;
  bool at_battery = false;
  double measured_j = signals::unmeasured;
  double before_j = 0;  // by the robot file as given
  double after_j = 0;   // by the calibrated one

  Json measured_at() const {
    return at_battery ? Json("battery") : std::isnan(measured_j) ? Json() : Json("motors");
  }
  double error_before() const { return before_j / measured_j - 1; }
  double error_after() const { return after_j / measured_j - 1; }
};

// One of both calibrations.
struct DriveOutcome {
  std::string method;
  std::optional<energy::DriveCalibration> by_motors;
  std::optional<energy::PowerCalibration> by_power;
  std::vector<CalibratedMission> missions;

  const robot::RobotModel& robot() const { return by_motors ? by_motors->robot : by_power->robot; }
  const std::vector<energy::ParameterEstimate>& estimates() const {
    return by_motors ? by_motors->estimates : by_power->estimates;
  }
};

// True if the method uses one of `channels` for identification or test.
bool uses(const std::string& method, const std::string& channels) {
  const auto names = [&](const char* field) { return channels.find(field) != std::string::npos; };
  return names("utime") || names("wheel_velocity") || names("battery_") ||
         (method != by_power && (names("motor_voltage") || names("motor_current")));
}

// The error of a contradicted channel, which would be identified as a property of the robot.
Result<void> refuse_contradicted(const robot::RobotModel& robot, const std::string& method,
                                 const std::vector<telemetry::Recording>& recordings) {
  const auto set = telemetry::make_recording_set(robot.robot_id, recordings);
  if (!set)
    return {};  // too short for the checks; the calibration reports recordings that are too short for it
  for (const plausibility::Check& check : plausibility::check_recordings(*set, robot)) {
    if (check.contradicted && uses(method, check.channel))
      return invalid(
          check.channel,
          check.says + " Correct the recordings, or use --contradicted to identify from them as they are.");
  }
  return {};
}

Result<std::vector<telemetry::Recording>> load(const CalibrateDriveOptions& options,
                                               const robot::RobotModel& robot) {
  const std::string& robot_id = robot.robot_id;
  LogProgress progress("reading", options.logs);
  TRY_ASSIGN(auto log, telemetry::read_recordings(options.logs, robot_id, progress.observer()));
  TRY(telemetry::need_robot(log, robot_id));
  std::vector<telemetry::Recording>& all = log.recordings;
  // Telemetry between missions is used only if the robot declares no missions.
  const bool declared = std::ranges::any_of(all, [](const auto& r) { return !r.implicit; });
  std::erase_if(all, [&](const auto& r) { return r.samples.empty() || (declared && r.implicit); });
  if (all.empty()) return invalid("log", "contains no usable telemetry of " + robot_id + " in a mission");
  for (telemetry::Recording& r : all)
    if (!std::isfinite(r.payload_kg)) r.payload_kg = 0;
  for (const telemetry::DroppedReadings& dropped : telemetry::drop_impossible(all, robot))
    fmt::print(stderr, "joulecast: {} samples count as not measured: {}\n", dropped.samples, dropped.why);
  for (const std::string& wanted : options.train) {
    if (wanted != "all" && std::ranges::none_of(all, [&](const auto& r) { return r.mission_id == wanted; }))
      return invalid("--train", "the logs contain no mission " + wanted + " of " + robot_id);
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

// Fills in the calibration, by its method and from the chosen missions.
Result<void> identify(const robot::RobotModel& robot, const CalibrateDriveOptions& options,
                      std::span<const telemetry::Recording> chosen, DriveOutcome& outcome) {
  const auto known = [&](const char* what) {
    return std::ranges::find(options.known, what) != options.known.end();
  };
  if (outcome.method == by_power) {
    Progress progress("identifying", "%", 100);
    TRY_ASSIGN(outcome.by_power,
               energy::calibrate_from_power(robot, chosen, {known("resistance"), progress.shares()}));
    return {};
  }
  energy::CalibrationOptions how;
  how.steady_fraction_1_s = options.steady_fraction_1_s;
  how.resistance_known = known("resistance");
  how.constants_known = known("constants");
  how.method = outcome.method == by_whole ? CalibrationMethod::whole : CalibrationMethod::steady;
  TRY_ASSIGN(outcome.by_motors, energy::calibrate_drive(robot, chosen, how));
  return {};
}

// Every third mission tests the others' fit, as at an adoption; with fewer than three all are needed.
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
    TRY_ASSIGN(const auto before, energy::metered(robot, run_drive, meter));
    TRY_ASSIGN(const auto after, energy::metered(outcome.robot(), run_drive, meter));
    CalibratedMission c{run_drive.name, train.contains(run_drive.name), after.measured_s > 0};
    if (c.at_battery)
      c.measured_j = after.measured_j;
    else if (after.motor_measured_s > 0)
      c.measured_j = after.measured_motor_j[0] + after.measured_motor_j[1];
    c.before_j = c.at_battery ? before.modelled_j : before.modelled_motor_j[0] + before.modelled_motor_j[1];
    c.after_j = c.at_battery ? after.modelled_j : after.modelled_motor_j[0] + after.modelled_motor_j[1];
    outcome.missions.push_back(c);
  }
  return {};
}

Result<DriveOutcome> calibrate(const CalibrateDriveOptions& options) {
  TRY_ASSIGN(const auto robot, robot::load_robot(options.robot_file));
  TRY_ASSIGN(const auto recordings, load(options, robot));
  std::set<std::string> train(options.train.begin(), options.train.end());
  const bool all_train = options.train == std::vector<std::string>{"all"};
  for (std::size_t k = 0; k < recordings.size(); ++k)
    if (all_train || (options.train.empty() && !held_out(k, recordings.size())))
      train.insert(recordings[k].mission_id);
  TRY_ASSIGN(const auto drive, dynamics::drive_model(robot));
  std::vector<energy::DriveRun> all;
  std::vector<telemetry::Recording> chosen;
  std::deque<std::vector<double>> climbs;
  for (const telemetry::Recording& r : recordings) {
    climbs.push_back(telemetry::climb_of(r, drive.parameters()));
    all.push_back({r.mission_id, r.samples, r.payload_kg, climbs.back()});
    if (train.contains(r.mission_id)) chosen.push_back(r);
  }
  DriveOutcome outcome;
  outcome.method = !options.method.empty()     ? options.method
                   : has_motor_current(chosen) ? by_steady
                                               : by_power;
  if (!options.contradicted) TRY(refuse_contradicted(robot, outcome.method, chosen));
  TRY(identify(robot, options, chosen, outcome));
  TRY(account(robot, all, train, outcome));
  return outcome;
}

void add_block(Json& document, const energy::PowerCalibration& fit) {
  document["blocks"] = fit.blocks;
  document["windows"] = fit.windows;
  document["effective_windows"] = fit.effective_windows;
  document["reading_s"] = fit.reading_s;
  document["held_readings"] = fit.held;
  document["slowest_rad_s"] = fit.slowest_rad_s;
  document["fastest_rad_s"] = fit.fastest_rad_s;
  document["power_w"] = fit.power_w;
  document["power_left_w"] = fit.left_w;
  document["other_half"] = {{"file_error", json_number(fit.halves.file)},
                            {"calibrated_error", json_number(fit.halves.corrected)},
                            {"regression_error", json_number(fit.halves.regression)}};
  document["untold"] = Json::array();
  for (const energy::Untold& u : fit.untold)
    document["untold"].push_back({{"parameter", u.what}, {"reason", u.why}});
}

void print(const energy::DriveCalibration& fit) {
  const bool volts = std::isfinite(fit.voltage_rms_v);
  fmt::print("from {} windows, wheels at {:.2f} to {:.2f} rad/s; residuals {}{:.3g} N m rms\n", fit.windows,
             fit.slowest_rad_s, fit.fastest_rad_s, volts ? fmt::format("{:.3g} V, ", fit.voltage_rms_v) : "",
             fit.torque_rms_nm);
  if (fit.electrical_delay_s != 0)
    fmt::print(
        "The voltages fit the currents and the speeds of {:.1f} ms {}: one of them is of another instant, as "
        "a mean beside a reading, or a reading at one phase of a controller's period. Record means over the "
        "same interval; the standard errors of the inertias include this error.\n",
        1e3 * std::fabs(fit.electrical_delay_s), fit.electrical_delay_s > 0 ? "later" : "earlier");
}

void print(const energy::PowerCalibration& fit) {
  fmt::print(
      "from battery power alone: {} windows in {} segments, equivalent to {:.0f} independent windows; wheels "
      "at {:.2f} to {:.2f} rad/s\n",
      fit.windows, fit.blocks, fit.effective_windows, fit.slowest_rad_s, fit.fastest_rad_s);
  if (fit.held) fmt::print("power has a new reading every {:.2g} s; rows between repeat it\n", fit.reading_s);
  fmt::print("mean absolute residual {:.3g} W of {:.4g} W\n", fit.left_w, fit.power_w);
  const energy::MissedPower& h = fit.halves;
  fmt::print(
      "power error of each half of the recordings, predicted from the other: {:.1f} %; robot file {:.1f} %, "
      "linear regression on speed, turning and acceleration {:.1f} %\n",
      1e2 * h.corrected, 1e2 * h.file, 1e2 * h.regression);
  if (h.regression_wins())
    fmt::print(
        "The regression predicts better: the power of this robot depends on an effect that its model lacks. "
        "Find it with joulecast gap.\n");
  fmt::print("\nNot identifiable from battery power:\n");
  for (const energy::Untold& u : fit.untold)
    if (std::ranges::find(fit.estimates, u.what, &energy::ParameterEstimate::name) == fit.estimates.end())
      fmt::print("- {}: {}.\n", u.what, u.why);
}

Json drive_json(const DriveOutcome& outcome) {
  Json document{{"robot", robot::robot_to_json(outcome.robot())},
                {"method", outcome.method},
                {"parameters", Json::array()},
                {"missions", Json::array()}};
  outcome.by_motors ? document.update(*outcome.by_motors) : add_block(document, *outcome.by_power);
  // Deviations of the parameters that battery power does not identify are reported too.
  const bool always = outcome.by_power.has_value();
  for (const energy::ParameterEstimate& e : outcome.estimates())
    document["parameters"].push_back(
        {{"name", e.name},
         {"unit", e.unit},
         {"value", e.value},
         {"standard_error", e.fitted || always ? json_number(e.standard_error) : nullptr},
         {"fitted", e.fitted},
         {"note", e.note}});
  for (const CalibratedMission& c : outcome.missions)
    document["missions"].push_back({{"mission_id", c.mission_id},
                                    {"trained_on", c.trained_on},
                                    {"measured_at", c.measured_at()},
                                    {"measured_j", json_number(c.measured_j)},
                                    {"file_j", c.before_j},
                                    {"calibrated_j", c.after_j},
                                    {"file_error", json_number(c.error_before())},
                                    {"calibrated_error", json_number(c.error_after())}});
  return document;
}

void print_text(const DriveOutcome& outcome, const std::string& unit) {
  // As wide as the longest name, which only battery power needs.
  const int width = outcome.by_motors ? 26 : 32;
  for (const energy::ParameterEstimate& e : outcome.estimates()) {
    fmt::print("{:<{}} {:>12.5g}", e.name, width, e.value);
    // A value that battery power does not identify is an estimate too, with a large error.
    const bool estimated = e.fitted || (outcome.by_power && e.standard_error > 0);
    estimated ? fmt::print(" ± {:<10.3g}", e.standard_error) : fmt::print(" {:<13}", "(held)");
    fmt::print(" {:<10} {}\n", e.unit, e.note);
  }
  outcome.by_motors ? print(*outcome.by_motors) : print(*outcome.by_power);
  if (outcome.by_motors && std::ranges::any_of(outcome.missions, &CalibratedMission::at_battery))
    fmt::print(
        "Idle power, scrub and regeneration are the robot file's: --method power estimates them from battery "
        "power.\n");
  fmt::print("\n");
  const Column used =
      text_column("used", [](const Json& row) { return row["trained_on"] == true ? "to fit" : "to test"; });
  const auto error = [](const char* member) {
    return text_column("error", [member](const Json& row) {
      const double share = number_or_nan(row[member]);
      return std::isfinite(share) ? without_sign_of_zero(fmt::format("{:+.1f} %", 1e2 * share)) : "-";
    });
  };
  print_rows(drive_json(outcome)["missions"], {{"mission", "mission_id"},
                                               used,
                                               {"at", "measured_at"},
                                               energy_column("measured", "measured_j", unit),
                                               energy_column("file", "file_j", unit),
                                               error("file_error"),
                                               energy_column("fitted", "calibrated_j", unit),
                                               error("calibrated_error")});
  std::size_t unused = 0, unmeasured = 0;
  double total = 0, missed = 0, missed_before = 0;
  for (const CalibratedMission& c : outcome.missions) {
    if (c.trained_on) continue;
    if (std::isnan(c.measured_j)) {
      ++unmeasured;
      continue;
    }
    ++unused;
    total += c.measured_j;
    missed += std::fabs(c.after_j - c.measured_j);
    missed_before += std::fabs(c.before_j - c.measured_j);
  }
  if (unused > 0)
    fmt::print("error on the {}: {:.1f} % of their energy; robot file {:.1f} %\n",
               count_of(unused, "held-out mission"), 1e2 * missed / total, 1e2 * missed_before / total);
  if (unmeasured > 0) fmt::print("no energy was measured in {}\n", count_of(unmeasured, "held-out mission"));
}

Result<Exit> run_drive(CalibrateDriveOptions& options) {
  TRY(may_write("--out", options.out, existing(options.force)));
  TRY_ASSIGN(const auto outcome, calibrate(options));
  // Any written file must be readable, for all measured values.
  TRY(robot::validate(outcome.robot()));
  if (!options.out.empty()) {
    const std::string text = robot::to_json_text(outcome.robot()) + "\n";
    TRY(write_text_file(options.out, text, existing(options.force)));
  }
  options.json ? print_json(drive_json(outcome)) : print_text(outcome, options.unit);
  return Exit::ok;
}

}  // namespace

void add_calibrate_drive(CLI::App& group, Exit& exit) {
  using O = CalibrateDriveOptions;
  add_command<O>(
      group, exit, "drive",
      "Estimate a drive from event logs, of motor voltages and currents or of battery power alone, and test "
      "it on other missions",
      run_drive,
      {{"log", &O::logs, "LCM event logs", file_of("lcmlog"), required},
       {"--robot", &O::robot_file, "initial robot file; its robot's missions are used", file_of("json"),
        required},
       {"--out", &O::out, "robot file to write", file_of("json")},
       {"--force", &O::force, force_help},
       {"--train", &O::train,
        "missions to fit, comma-separated, or all; the others are the test (default: two of three)",
        named("ID"), commas},
       {"--method", &O::method,
        "steady: thesis (3-1) at constant speed; whole: every moving sample; power: battery power alone, "
        "with a list of the parameters that it cannot identify (default: steady, or power if no motor "
        "current was recorded)",
        one_of({by_steady, by_whole, by_power})},
       {"--known", &O::known, "parameters to keep from the robot file: resistance, constants",
        one_of({"resistance", "constants"}), commas},
       {"--steady-acceleration", &O::steady_fraction_1_s,
        "greatest acceleration at constant speed, as a fraction of the top speed per second", positive()},
       {"--contradicted", &O::contradicted,
        "use also channels that joulecast check reports as contradicted, for instance because of a "
        "mismatched robot file"},
       unit_row<O>(),
       {"--json", &O::json, "print the result as JSON"}},
      "joulecast calibrate drive amr.lcmlog --robot amr.json --out amr-calibrated.json");
}

}  // namespace joulecast::client
