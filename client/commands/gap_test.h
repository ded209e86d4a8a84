#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "energy/back_test.h"
#include "energy/regression_comparison.h"

namespace joulecast::client {

// `joulecast gap --test`: a robot file and the one with the effects found, on missions that were not
// diagnosed; with enough battery power, also a plain regression on the missions that were.
struct GapTest {
  energy::BackTest replayed;
  Result<energy::RegressionComparison> beside_regression;

  std::string objection() const;  // to writing the corrected file; empty without
};

Result<GapTest> test_on_other_missions(const std::vector<std::string>& logs, const std::string& robot_id,
                                       std::span<const telemetry::Recording> diagnosed,
                                       const robot::RobotModel& robot, const robot::RobotModel& corrected);

nlohmann::ordered_json to_json(const GapTest& test);
void print(const GapTest& test, const std::string& unit);

}  // namespace joulecast::client
