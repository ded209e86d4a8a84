#include "client/commands/drive_calibration_output.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

void add_block(nlohmann::json& document, const energy::DriveCalibration& fit) {
  document["blocks"] = fit.blocks;
  document["windows"] = fit.windows;
  document["slowest_rad_s"] = fit.slowest_rad_s;
  document["fastest_rad_s"] = fit.fastest_rad_s;
  document["voltage_rms_v"] = json_number(fit.voltage_rms_v);
  document["torque_rms_nm"] = json_number(fit.torque_rms_nm);
  document["electrical_delay_s"] = fit.electrical_delay_s;
}

void add_block(nlohmann::json& document, const energy::PowerCalibration& fit) {
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
  document["untold"] = nlohmann::json::array();
  for (const energy::Untold& u : fit.untold)
    document["untold"].push_back({{"parameter", u.what}, {"reason", u.why}});
}

void print(const energy::DriveCalibration& fit) {
  fmt::print("from {} windows, wheels at {:.2f} to {:.2f} rad/s; residuals {:.3g} V, {:.3g} N m rms\n",
             fit.windows, fit.slowest_rad_s, fit.fastest_rad_s, fit.voltage_rms_v, fit.torque_rms_nm);
  if (fit.electrical_delay_s != 0)
    fmt::print(
        "Voltages and currents are {:.1f} ms apart: readings at one phase of a controller's period. Record "
        "their means; until then the inertias are as uncertain as stated.\n",
        1e3 * std::fabs(fit.electrical_delay_s));
  fmt::print("\n");
}

void print(const energy::PowerCalibration& fit) {
  fmt::print(
      "from battery power alone: {} windows in {} segments, equivalent to {:.0f} independent windows; "
      "wheels at {:.2f} to {:.2f} rad/s\n",
      fit.windows, fit.blocks, fit.effective_windows, fit.slowest_rad_s, fit.fastest_rad_s);
  if (fit.held) fmt::print("power was read every {:.2g} s; rows between repeat it\n", fit.reading_s);
  fmt::print("mean absolute residual {:.3g} W of {:.4g} W\n", fit.left_w, fit.power_w);
  const energy::MissedPower& h = fit.halves;
  fmt::print(
      "power error of each half of the recordings, predicted from the other: {:.1f} %; robot file {:.1f} %, "
      "linear regression on speed, turning and acceleration {:.1f} %\n",
      1e2 * h.corrected, 1e2 * h.file, 1e2 * h.regression);
  constexpr double clearly_worse = 1.05;
  if (h.corrected > clearly_worse * h.regression)
    fmt::print(
        "The regression predicts better: the power of this robot depends on an effect that its model lacks. "
        "Find it with joulecast gap.\n");
  fmt::print("\nNot identifiable from battery power:\n");
  for (const energy::Untold& u : fit.untold) fmt::print("- {}: {}.\n", u.what, u.why);
  fmt::print("\n");
}

void print(const std::vector<CalibratedMission>& missions) {
  fmt::print("{:<32} {:<8} {:<8} {:>12} {:>12} {:>9} {:>12} {:>9}\n", "mission", "used", "at", "measured J",
             "file J", "error", "fitted J", "error");
  double unused = 0, total = 0, error = 0;
  for (const CalibratedMission& c : missions) {
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

}  // namespace

void print_json(const DriveOutcome& outcome) {
  nlohmann::json document{{"robot", robot::robot_to_json(outcome.robot())},
                          {"method", outcome.method},
                          {"parameters", nlohmann::json::array()},
                          {"missions", nlohmann::json::array()}};
  outcome.by_motors ? add_block(document, *outcome.by_motors) : add_block(document, *outcome.by_power);
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
                                    {"measured_at", c.at_battery ? "battery" : "motors"},
                                    {"measured_j", c.measured_j},
                                    {"file_j", c.before_j},
                                    {"calibrated_j", c.after_j},
                                    {"file_error", json_number(c.error_before())},
                                    {"calibrated_error", json_number(c.error_after())}});
  std::puts(document.dump(2).c_str());
}

void print_text(const DriveOutcome& outcome) {
  // As wide as the longest name, which only battery power needs.
  const int width = outcome.by_motors ? 26 : 32;
  for (const energy::ParameterEstimate& e : outcome.estimates()) {
    fmt::print("{:<{}} {:>12.5g}", e.name, width, e.value);
    e.fitted ? fmt::print(" +- {:<10.3g}", e.standard_error) : fmt::print(" {:<13}", "(held)");
    fmt::print(" {:<10} {}\n", e.unit, e.note);
  }
  outcome.by_motors ? print(*outcome.by_motors) : print(*outcome.by_power);
  print(outcome.missions);
}

}  // namespace joulecast::client
