#pragma once

#include <string>
#include <vector>

#include "gap/compare.h"
#include "gap/diagnosis.h"
#include "gap/mission_level.h"

namespace joulecast::gap {

// What a report says of its own origin.
struct ReportOrigin {
  std::vector<std::string> sources;  // names of logs or tables, or what else was read; no paths
  std::string model;                 // name of the robot file, or the version in the daemon
  std::string made_at;               // UTC, as 2026-01-31 12:00; empty: not said
  std::string software;              // name and version
};

// A diagnosis as one HTML page that needs nothing else: verdict, effects, maps, power over time, method,
// limits and origin of the data, for a reader who was not there.
std::string report_html(const Diagnosis& diagnosis, const telemetry::RecordingSet& recordings,
                        const robot::RobotModel& robot, const ReportOrigin& origin);

// The same for a diagnosis from energies of runs.
std::string report_html(const MissionDiagnosis& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin);

// The same for a comparison of groups of recordings.
std::string report_html(const Comparison& comparison, const robot::RobotModel& robot,
                        const ReportOrigin& origin);

}  // namespace joulecast::gap
