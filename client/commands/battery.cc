#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/try.h"
#include "battery/circuit.h"
#include "battery/prediction.h"
#include "client/commands/accepts.h"
#include "client/commands/table.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

using battery::Load;

struct BatteryOptions {
  std::string battery;
  std::vector<std::string> recordings;
  Load::Kind from = Load::Kind::current;
  bool json = false;
};

const std::vector<std::pair<std::string, Load::Kind>> kinds{{"current", Load::Kind::current},
                                                            {"power", Load::Kind::power}};

struct Predicted {
  std::vector<battery::Prediction> done;
  std::vector<std::pair<std::string, Error>> failed;  // recording, why
};

Result<Predicted> predict_all(const BatteryOptions& options) {
  TRY_ASSIGN(const auto parameters, robot::load_battery(options.battery));
  const battery::Circuit circuit(parameters);
  Predicted predictions;
  for (const std::string& source : options.recordings) {
    TRY_ASSIGN(const auto files, battery::discharge_files(source));
    for (const auto& file : files) {
      TRY_ASSIGN(const auto recordings, battery::read_recordings(file));
      for (const battery::Recording& recording : recordings) {
        const auto prediction = battery::predict(circuit, recording, options.from);
        if (prediction) {
          predictions.done.push_back(*prediction);
        } else {
          predictions.failed.emplace_back(recording.name, prediction.error());
        }
      }
    }
  }
  if (predictions.done.empty()) return tl::unexpected(predictions.failed.front().second);
  return predictions;
}

void print_prediction_json(const BatteryOptions& options, const Predicted& predicted) {
  const std::vector<battery::Prediction>& predictions = predicted.done;
  const battery::PredictionSummary summary = battery::summarise(predictions);
  nlohmann::json document{{"from", options.from == Load::Kind::current ? "current" : "power"},
                          {"discharges", nlohmann::json::array()},
                          {"summary",
                           {{"count", summary.count},
                            {"time_error_median", summary.time_error_median},
                            {"time_error_p95", summary.time_error_p95},
                            {"voltage_rms_v", summary.voltage_rms_v},
                            {"voltage_rms_worst_v", summary.voltage_rms_worst_v},
                            {"voltage_rms_by_capacity_v", summary.voltage_rms_by_capacity_v}}}};
  for (const battery::Prediction& p : predictions)
    document["discharges"].push_back({{"name", p.name},
                                      {"end_voltage_v", p.end_voltage_v},
                                      {"measured_s", p.measured_s},
                                      {"predicted_s", p.predicted_s},
                                      {"time_error", p.time_error},
                                      {"voltage_rms_v", p.voltage_rms_v},
                                      {"voltage_rms_by_capacity_v", p.voltage_rms_by_capacity_v}});
  document["failed"] = nlohmann::json::array();
  for (const auto& [name, error] : predicted.failed)
    document["failed"].push_back({{"name", name}, {"reason", describe(error)}});
  std::puts(document.dump(2).c_str());
}

void print_prediction(const Predicted& predicted) {
  const std::vector<battery::Prediction>& predictions = predicted.done;
  fmt::print("{:<24} {:>7} {:>11} {:>12} {:>7} {:>10}\n", "discharge", "end V", "measured s", "predicted s",
             "error", "rms mV");
  for (const battery::Prediction& p : predictions)
    fmt::print("{:<24} {:>7.3f} {:>11.0f} {:>12.1f} {:>6.2f}% {:>10.1f}\n", p.name, p.end_voltage_v,
               p.measured_s, p.predicted_s, 1e2 * p.time_error, 1e3 * p.voltage_rms_v);
  const battery::PredictionSummary summary = battery::summarise(predictions);
  fmt::print(
      "{} discharges; time error: median {:.2f} %, 95th percentile {:.2f} %; voltage rms above {:.0f} % "
      "of the charge delivered: {:.1f} mV, worst {:.1f} mV; of the capacity: {:.1f} mV\n",
      summary.count, 1e2 * summary.time_error_median, 1e2 * summary.time_error_p95,
      1e2 * battery::least_charge, 1e3 * summary.voltage_rms_v, 1e3 * summary.voltage_rms_worst_v,
      1e3 * summary.voltage_rms_by_capacity_v);
  for (const auto& [name, error] : predicted.failed)
    fmt::print("not predicted: {}: {}\n", name, describe(error));
}

Exit run_battery(const BatteryOptions& options) {
  const auto predictions = predict_all(options);
  if (!predictions) return report(predictions.error());
  if (options.json) {
    print_prediction_json(options, *predictions);
  } else {
    print_prediction(*predictions);
  }
  return Exit::ok;
}

}  // namespace

void add_battery(CLI::App& program, Exit& exit) {
  auto* group = program.add_subcommand("battery", "Predict with a battery model");
  group->require_subcommand(1);
  auto options = std::make_shared<BatteryOptions>();
  auto* command = group->add_subcommand("predict",
                                        "Predict recorded discharges from their current or power, and "
                                        "compare the time until the voltage where they "
                                        "end (the cut-off, if that is higher) and the voltage on the way");
  command
      ->add_option("recordings", options->recordings,
                   "CSV files (columns t_s, I_A discharging positive, V_V, T_C, cycle: each value a "
                   "discharge of its own), a "
                   "folder, or the common beginning of the names of one battery's files, which selects "
                   "<beginning>_rw.csv. Each discharge begins full and at rest")
      ->required();
  command->add_option("--battery", options->battery, "battery object of a robot file, as calibrate writes it")
      ->required();
  command->add_option("--from", options->from, "what of the recording is given to the model")
      ->transform(one_of(kinds))
      ->default_str("current");
  command->add_flag("--json", options->json, "print the result as JSON");
  command->callback([options, &exit] { exit = run_battery(*options); });
}

}  // namespace joulecast::client
