#include "energy/back_test_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_number.h"

namespace joulecast::energy {
namespace {

using Json = nlohmann::json;

Json error_of(const ModelError& e) {
  return {{"energy_j", json_number(e.energy_j)},
          {"relative", json_number(e.relative)},
          {"ci", json_interval(e.interval)},
          {"power_absolute_relative", json_number(e.power_absolute_relative)}};
}

}  // namespace

Json back_test_to_json(const BackTest& test) {
  Json out;
  out["missions"] = Json::array();
  for (const RunComparison& run : test.runs) {
    out["missions"].push_back({{"mission_id", run.name},
                               {"basis", run.at_battery ? "battery" : "motors"},
                               {"measured_j", json_number(run.measured_j)},
                               {"duration_s", json_number(run.duration_s)},
                               {"before", error_of(run.before)},
                               {"after", error_of(run.after)}});
  }
  const bool any = !test.runs.empty();
  const auto known = [&](double value) { return any ? json_number(value) : Json(nullptr); };
  out["error_before"] = known(test.error_before);
  out["error_after"] = known(test.error_after);
  out["improvement"] = known(test.improvement());
  out["improvement_ci"] = json_interval(test.improvement_interval);
  out["power_gap_before"] = known(test.power_gap_before);
  out["power_gap_after"] = known(test.power_gap_after);
  out["power_gap_fall_ci"] = json_interval(test.power_gap_fall_interval);
  out["voltage_gap_before"] = known(test.voltage_gap_before);
  out["voltage_gap_after"] = known(test.voltage_gap_after);
  out["voltage_gap_fall_ci"] = json_interval(test.voltage_gap_fall_interval);
  out["improves"] = test.improves();
  return out;
}

}  // namespace joulecast::energy
