#pragma once

#include <string>
#include <vector>

#include "gap/verdict/diagnosis.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// What a report says of its own origin.
struct ReportOrigin {
  std::vector<std::string> sources;  // names of logs or tables, or what else was read; no paths
  std::string model;                 // name of the robot file, or the version in the daemon
  std::string made_at;               // UTC, as 2026-01-31 12:00; empty: not said
  std::string software;              // name and version
};

// A diagnosis as one HTML page that needs nothing else, for a reader who was not there: checks, effects, the
// plain regression beside them, maps, power over time, limits and origin of the data. It shows what the
// diagnosis and its figures hold and computes nothing; `robot` is the model that was judged.
std::string report_html(const Diagnosis& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin);

}  // namespace joulecast::gap
