#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/try.h"
#include "battery/circuit.h"
#include "battery/discharge.h"
#include "client/commands/option.h"
#include "client/commands/print.h"
#include "client/commands/table.h"
#include "robot/robot_file.h"

namespace joulecast::battery {
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Prediction, name, end_voltage_v, measured_s, predicted_s, time_error,
                                   voltage_rms_v, voltage_rms_by_capacity_v)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PredictionSummary, count, time_error_median, time_error_p95, voltage_rms_v,
                                   voltage_rms_worst_v, voltage_rms_by_capacity_v)
}  // namespace joulecast::battery

namespace joulecast::client {
namespace {

struct BatteryOptions {
  std::string battery, from = "current";
  std::vector<std::string> recordings;
  bool json = false;
};

struct Predicted {
  std::vector<battery::Prediction> done;
  std::vector<std::pair<std::string, Error>> failed;  // recording, why
};

Result<Predicted> predict_all(const BatteryOptions& options) {
  TRY_ASSIGN(const auto parameters, robot::load_battery(options.battery));
  const battery::Circuit circuit(parameters);
  const auto kind = options.from == "power" ? battery::Load::Kind::power : battery::Load::Kind::current;
  Predicted predictions;
  for (const std::string& source : options.recordings) {
    TRY_ASSIGN(const auto files, battery::discharge_files(source));
    for (const auto& file : files) {
      TRY_ASSIGN(const auto recordings, battery::read_recordings(file));
      for (const battery::Recording& recording : recordings) {
        const auto prediction = battery::predict(circuit, recording, kind);
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

Json prediction_json(const BatteryOptions& options, const Predicted& predicted) {
  Json document{{"from", options.from},
                {"discharges", predicted.done},
                {"failed", Json::array()},
                {"summary", battery::summarise(predicted.done)}};
  for (const auto& [name, error] : predicted.failed)
    document["failed"].push_back({{"name", name}, {"reason", describe(error)}});
  return document;
}

void print_prediction(const Json& document) {
  print_rows(document["discharges"], {{"discharge", "name"},
                                      {"end V", "end_voltage_v", 3},
                                      {"measured s", "measured_s", 0},
                                      {"predicted s", "predicted_s", 1},
                                      {"error %", "time_error", 2, 1e2},
                                      {"rms mV", "voltage_rms_v", 1, 1e3}});
  const Json& summary = document["summary"];
  const auto figure = [&](const char* name, int decimals, double scale) {
    return number_of(summary, name, decimals, scale);
  };
  fmt::print(
      "{0}; time error: median {1} %, 95th percentile {2} %\n"
      "voltage error until {3:.0f} % of the delivered charge is left: rms {4} mV, worst discharge {5} mV; "
      "until {3:.0f} % of the capacity is left: rms {6} mV\n",
      count_of(summary["count"], "discharge"), figure("time_error_median", 2, 1e2),
      figure("time_error_p95", 2, 1e2), 1e2 * battery::least_charge, figure("voltage_rms_v", 1, 1e3),
      figure("voltage_rms_worst_v", 1, 1e3), figure("voltage_rms_by_capacity_v", 1, 1e3));
  for (const Json& each : document["failed"])
    fmt::print("not predicted: {}: {}\n", text_of(each["name"]), text_of(each["reason"]));
}

Result<Exit> run_battery(BatteryOptions& options) {
  TRY_ASSIGN(const auto predictions, predict_all(options));
  const Json document = prediction_json(options, predictions);
  options.json ? print_json(document) : print_prediction(document);
  return Exit::ok;
}

}  // namespace

void add_battery(CLI::App& program, Exit& exit) {
  using O = BatteryOptions;
  auto& group = add_group(program, "battery", "Predict discharges with a battery model");
  add_command<O>(
      group, exit, "predict",
      "Predict recorded discharges from their current or power, and compare the voltage, and the time to the "
      "voltage at their end (the cut-off, if that is higher)",
      run_battery,
      {{"recordings", &O::recordings,
        "CSV files (columns t_s, I_A discharging positive, V_V, T_C, cycle: the number of the "
        "discharge), a folder, or the common beginning of the names of one battery's files, which selects "
        "<beginning>_rw.csv. Each discharge begins full and at rest",
        file_of("csv"), required},
       {"--battery", &O::battery, "battery as calibrate writes it, or robot file with its battery",
        file_of("json"), required},
       {"--from", &O::from, "recorded quantity from which the model predicts", one_of({"current", "power"})},
       {"--json", &O::json, "print the result as JSON"}},
      "joulecast battery predict cell_rw.csv --battery cell.json\n"
      "joulecast battery predict cell --battery cell.json --from power --json");
}

}  // namespace joulecast::client
