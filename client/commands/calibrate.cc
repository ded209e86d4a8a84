#include "battery/calibrate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "battery/recording.h"
#include "client/commands/accepts.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

struct Options {
  std::vector<std::string> sources;
  std::optional<double> rated_capacity_ah;
  double reserve_fraction = battery::CalibrationOptions{}.reserve_fraction;
  std::string out;
  bool json = false;
  bool force = false;
};

struct Read {
  std::vector<battery::Recording> recordings;
  std::vector<battery::PassedOver> unreadable;  // of the files that a folder or a beginning stands for
};

Result<Read> read_all(const std::vector<std::string>& sources) {
  Read all;
  for (const std::string& source : sources) {
    const auto files = battery::identification_files(source);
    if (!files) return tl::unexpected(files.error());
    for (const auto& file : *files) {
      auto recordings = battery::read_recordings(file);
      if (!recordings && files->size() == 1) return tl::unexpected(recordings.error());
      if (!recordings) {
        all.unreadable.push_back({file.filename().string(), describe(recordings.error())});
        continue;
      }
      for (auto& recording : *recordings) all.recordings.push_back(std::move(recording));
    }
  }
  return all;
}

void print_json(const battery::Calibration& calibration) {
  nlohmann::json document{{"battery", robot::battery_to_json(calibration.battery)},
                          {"iterations", calibration.iterations},
                          {"recordings", nlohmann::json::array()}};
  for (const battery::RecordingFit& fit : calibration.recordings)
    document["recordings"].push_back(
        {{"name", fit.name}, {"open_circuit", fit.open_circuit}, {"voltage_rms_v", fit.voltage_rms_v}});
  document["passed_over"] = nlohmann::json::array();
  for (const battery::PassedOver& p : calibration.passed_over)
    document["passed_over"].push_back({{"name", p.name}, {"reason", p.reason}});
  std::puts(document.dump(2).c_str());
}

void print_text(const battery::Calibration& calibration) {
  const robot::Battery& battery = calibration.battery;
  fmt::print("capacity            {:.4f} Ah\n", battery.capacity_ah * battery.ageing_factor.value_or(1));
  if (battery.ageing_factor) fmt::print("ageing factor       {:.4f}\n", *battery.ageing_factor);
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
  for (const battery::RecordingFit& fit : calibration.recordings)
    fmt::print("{:<32} voltage rms {:5.1f} mV{}\n", fit.name, 1e3 * fit.voltage_rms_v,
               fit.open_circuit ? ", gives the open-circuit voltage" : "");
  for (const battery::PassedOver& p : calibration.passed_over)
    fmt::print("passed over: {}: {}\n", p.name, p.reason);
}

Exit run(const Options& options) {
  if (const auto may = may_write("--out", options.out, existing(options.force)); !may)
    return report(may.error());
  auto read = read_all(options.sources);
  if (!read) return report(read.error());
  auto calibration =
      battery::calibrate(read->recordings, {options.rated_capacity_ah, options.reserve_fraction});
  if (!calibration) {
    for (const battery::PassedOver& p : read->unreadable)
      fmt::print(stderr, "joulecast: passed over: {}: {}\n", p.name, p.reason);
    return report(calibration.error());
  }
  std::ranges::move(read->unreadable, std::back_inserter(calibration->passed_over));
  const std::string text = robot::to_json_text(calibration->battery);
  // What is written must be readable again, whatever was measured.
  if (const auto checked = robot::parse_battery(text); !checked) return report(checked.error());
  if (const auto written = write_text_file(options.out, text + '\n', existing(options.force)); !written)
    return report(written.error());
  if (options.json) {
    print_json(*calibration);
  } else {
    print_text(*calibration);
  }
  return Exit::ok;
}

}  // namespace

void add_calibrate(CLI::App& program, Exit& exit) {
  auto* calibrate = program.add_subcommand("calibrate", "Identify parameters from recordings");
  calibrate->require_subcommand(1);
  add_calibrate_drive(*calibrate, exit);
  auto options = std::make_shared<Options>();
  auto* command = calibrate->add_subcommand("battery",
                                            "Identify a battery from CSV recordings (columns t_s, I_A "
                                            "discharging positive, V_V, T_C) of a slow full "
                                            "discharge, pulses and constant currents");
  command
      ->add_option(
          "recordings", options->sources,
          "CSV files, a folder of one battery's tests, or the common beginning of their names: "
          "<beginning>_*_data.csv, or else <beginning>_*.csv; <beginning>_rw.csv is kept to try the battery "
          "on. "
          "Each test begins full and at rest. The slowest full discharge gives the open-circuit voltage, "
          "whatever its name")
      ->required();
  command->add_option("--capacity-ah", options->rated_capacity_ah, "rated capacity; gives an ageing factor")
      ->check(positive());
  command->add_option("--reserve", options->reserve_fraction, "share of the charge that planning leaves")
      ->check(between(0.0, 0.99))
      ->capture_default_str();
  command->add_option("--out", options->out, "file for the battery object of a robot file")->required();
  command->add_flag("--force", options->force, force_help);
  command->add_flag("--json", options->json, "print the result as JSON");
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client
