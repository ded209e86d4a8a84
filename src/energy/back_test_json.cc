#include "energy/back_test_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace joulecast::energy {
namespace {

using nlohmann::json;

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

json interval(const std::array<double, 2>& ends) {
  return json::array({number(ends[0]), number(ends[1])});
}

json error_of(const ModelError& e) {
  return {{"energy_j", number(e.energy_j)},
          {"relative", number(e.relative)},
          {"ci", interval(e.interval)},
          {"power_absolute_relative", number(e.power_absolute_relative)}};
}

}  // namespace

json back_test_to_json(const BackTest& test) {
  json out;
  out["missions"] = json::array();
  for (const RunComparison& run : test.runs) {
    out["missions"].push_back({{"mission_id", run.name},
                               {"basis", run.at_battery ? "battery" : "motors"},
                               {"measured_j", number(run.measured_j)},
                               {"duration_s", number(run.duration_s)},
                               {"before", error_of(run.before)},
                               {"after", error_of(run.after)}});
  }
  const bool any = !test.runs.empty();
  const auto known = [&](double value) { return any ? number(value) : json(nullptr); };
  out["error_before"] = known(test.error_before);
  out["error_after"] = known(test.error_after);
  out["improvement"] = known(test.improvement());
  out["improvement_ci"] = interval(test.improvement_interval);
  out["power_gap_before"] = known(test.power_gap_before);
  out["power_gap_after"] = known(test.power_gap_after);
  out["improves"] = test.improves();
  return out;
}

}  // namespace joulecast::energy
