#include "battery/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/try.h"
#include "battery/coverage.h"
#include "battery/recording.h"
#include "client/commands/option.h"
#include "client/commands/print.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"
#include "robot/robot_file.h"

namespace joulecast::battery {
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(AtBound, field, bound)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(RecordingFit, name, open_circuit, voltage_rms_v)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PassedOver, name, reason)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Coverage::FastestLeftOut, name, rate_1_h, seen_to_1_h, time_error,
                                   own_time_error, voltage_rms_v, own_voltage_rms_v)
}  // namespace joulecast::battery

namespace joulecast::client {
namespace {

struct CalibrateOptions {
  std::vector<std::string> sources;
  std::optional<double> rated_capacity_ah;
  double reserve_fraction = battery::CalibrationOptions{}.reserve_fraction;
  std::string out;
  bool json = false;
  bool force = false;
};

struct Read {
  std::vector<battery::Recording> recordings;
  std::vector<battery::PassedOver> unreadable;  // of the files that a folder or a beginning selects
};

Result<Read> read_all(const std::vector<std::string>& sources) {
  Read all;
  for (const std::string& source : sources) {
    TRY_ASSIGN(const auto files, battery::identification_files(source));
    for (const auto& file : files) {
      auto recordings = battery::read_recordings(file);
      if (!recordings && files.size() == 1) return tl::unexpected(recordings.error());
      if (!recordings) {
        all.unreadable.push_back({file.filename().string(), describe(recordings.error())});
        continue;
      }
      for (auto& recording : *recordings) all.recordings.push_back(std::move(recording));
    }
  }
  return all;
}

Json coverage_json(const battery::Coverage& seen) {
  Json document{{"slow_rate_1_h", seen.slow_rate_1_h},  {"least_rate_1_h", seen.least_rate_1_h},
                {"most_rate_1_h", seen.most_rate_1_h},  {"temperature_c", nullptr},
                {"lowest_charge", seen.lowest_charge},  {"charging", seen.charging},
                {"fastest_left_out", nullptr},          {"unseen_temperatures", Json::array()},
                {"sentences", battery::sentences(seen)}};
  if (seen.temperature_c) document["temperature_c"] = *seen.temperature_c;
  if (seen.fastest_left_out) document["fastest_left_out"] = *seen.fastest_left_out;
  for (const battery::Coverage::Temperature& t : seen.unseen_temperatures)
    document["unseen_temperatures"].push_back({{"temperature_c", t.temperature_c},
                                               {"rate_1_h", t.rate_1_h},
                                               {"duration_by_this", t.by_this},
                                               {"duration_least", t.least},
                                               {"duration_most", t.most}});
  return document;
}

Json calibration_json(const battery::Calibration& calibration, const battery::Coverage& seen) {
  return {{"battery", robot::battery_to_json(calibration.battery)},
          {"at_bounds", calibration.at_bounds},
          {"iterations", calibration.iterations},
          {"recordings", calibration.recordings},
          {"passed_over", calibration.passed_over},
          {"coverage", coverage_json(seen)}};
}

void print_calibration(const battery::Calibration& calibration, const battery::Coverage& seen) {
  const robot::Battery& battery = calibration.battery;
  fmt::print("capacity            {:.4f} Ah\n", battery.capacity_ah * battery.ageing_factor.value_or(1));
  if (battery.ageing_factor)
    fmt::print("ageing factor       {:.4f} of the rated {:.4g} Ah\n", *battery.ageing_factor,
               battery.capacity_ah);
  fmt::print("nominal voltage     {:.3f} V, cut-off {:.3f} V\n", battery.nominal_voltage_v,
             *battery.cutoff_voltage_v);
  fmt::print("ohmic resistance    {:.4f} ohm at half charge\n", battery.internal_resistance_ohm);
  for (const robot::BatteryBranch& branch : battery.branches)
    fmt::print("branch              {:.4f} ohm, {:.1f} s\n", branch.resistance_ohm, branch.time_constant_s);
  for (const robot::ChargeLag& lag : battery.charge_lags)
    fmt::print("charge lag          {:.1f} s, {:.1f} s\n", lag.lag_s, lag.time_constant_s);
  if (battery.activation_k) fmt::print("activation          {:.0f} K\n", *battery.activation_k);
  if (battery.thermal_resistance_k_w)
    fmt::print("to surroundings     {:.2f} K/W, {:.0f} s\n", *battery.thermal_resistance_k_w,
               *battery.thermal_time_constant_s);
  for (const battery::AtBound& at : calibration.at_bounds)
    fmt::print(
        "{} = {:.4g} is at the bound of its search: the true value may lie beyond it, or the recordings "
        "do not determine it\n",
        at.field, at.bound);
  for (const battery::RecordingFit& fit : calibration.recordings)
    fmt::print("{:<32} voltage rms {:5.1f} mV{}\n", fit.name, 1e3 * fit.voltage_rms_v,
               fit.open_circuit ? ", gives the open-circuit voltage" : "");
  for (const battery::PassedOver& p : calibration.passed_over)
    fmt::print("skipped: {}: {}\n", p.name, p.reason);
  fmt::print("tested: rates of {:.2g} to {:.2g} C, and {:.2g} C for a full discharge", seen.least_rate_1_h,
             seen.most_rate_1_h, seen.slow_rate_1_h);
  if (seen.temperature_c)
    fmt::print("; {:.0f} to {:.0f} °C", seen.temperature_c->first, seen.temperature_c->second);
  fmt::print("\n");
  for (const std::string& sentence : battery::sentences(seen)) fmt::print("- {}.\n", sentence);
}

Result<battery::Calibration> fitted(const std::vector<battery::Recording>& recordings,
                                    battery::CalibrationOptions how) {
  Progress progress("identifying", "steps");
  how.on_step = [&](int step) { progress.reach(static_cast<std::uint64_t>(step)); };
  return battery::calibrate(recordings, how);
}

Result<Exit> run_calibrate(CalibrateOptions& options) {
  TRY(may_write("--out", options.out, existing(options.force)));
  TRY_ASSIGN(auto read, read_all(options.sources));
  const battery::CalibrationOptions how{options.rated_capacity_ah, options.reserve_fraction};
  auto calibration = fitted(read.recordings, how);
  if (!calibration) {
    for (const battery::PassedOver& p : read.unreadable)
      fmt::print(stderr, "joulecast: skipped: {}: {}\n", p.name, p.reason);
    return tl::unexpected(calibration.error());
  }
  TRY_ASSIGN(const auto seen, battery::coverage(read.recordings, *calibration, how));
  std::ranges::move(read.unreadable, std::back_inserter(calibration->passed_over));
  const std::string text = robot::to_json_text(calibration->battery);
  // Any written file must be readable, for all measured values.
  TRY(robot::parse_battery(text));
  TRY(write_text_file(options.out, text + '\n', existing(options.force)));
  options.json ? print_json(calibration_json(*calibration, seen)) : print_calibration(*calibration, seen);
  return Exit::ok;
}

}  // namespace

void add_calibrate(CLI::App& program, Exit& exit) {
  using O = CalibrateOptions;
  auto& group = add_group(program, "calibrate", "Estimate parameters from recordings");
  add_calibrate_drive(group, exit);
  add_command<O>(
      group, exit, "battery",
      "Estimate a battery from CSV recordings (columns t_s, I_A discharging positive, V_V, T_C) of a slow "
      "full discharge, pulses and constant currents",
      run_calibrate,
      {{"recordings", &O::sources,
        "CSV files, a folder of one battery's tests (alike up to the first _ of their names), or the common "
        "beginning of their names: <beginning>_*_data.csv, or else <beginning>_*.csv; <beginning>_rw.csv is "
        "left for battery predict. Each test begins full and at rest. The slowest full discharge, under any "
        "name, gives the open-circuit voltage",
        file_of("csv"), required},
       {"--capacity-ah", &O::rated_capacity_ah, "rated capacity, Ah; determines an ageing factor",
        positive()},
       {"--reserve", &O::reserve_fraction, "fraction of the charge that planning keeps in reserve",
        between(0.0, 0.99)},
       {"--out", &O::out, "file for the battery object of a robot file", file_of("json"), required},
       {"--force", &O::force, force_help},
       {"--json", &O::json, "print the result as JSON"}},
      "joulecast calibrate battery cell --capacity-ah 2.6 --out cell.json\n"
      "joulecast calibrate battery cell_c20_data.csv cell_1c_data.csv --out cell.json --force");
}

}  // namespace joulecast::client
