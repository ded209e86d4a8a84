#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "robot/robot_model.h"

namespace joulecast::report {

struct ReportOrigin {
  std::vector<std::string> sources;  // names of logs, tables or missions; no paths
  std::string model;                 // name of the robot file, or the version in the daemon
  std::string made_at;               // UTC, as 2026-01-31 12:00; empty: omitted
  std::string software;              // name and version
};

// Returns an HTML file that needs no server: the operator page's view of a diagnosis with the diagnosis
// inside. `diagnosis` is the JSON of a diagnosis of recordings, of runs or between groups; `robot` is the
// model that was diagnosed.
std::string report_html(const nlohmann::ordered_json& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin);

// The motion of a profile or estimate, with its baselines, over time, as an SVG document: speed where one
// drives, yaw rate where one turns, power and energy. Fault::corrupt where the answer has no columns.
[[nodiscard]] Result<std::string> draw_answer(const nlohmann::json& answer);

// Round values that span a range.
std::vector<double> ticks_of(double low, double high, int about);

}  // namespace joulecast::report
