#pragma once

#include <string>
#include <vector>

#include "gap/groups/compare.h"
#include "gap/runs/diagnose_runs.h"
#include "gap/verdict/diagnosis.h"
#include "robot/robot_model.h"

// Diagnoses as self-contained HTML pages, for readers without other knowledge of the recordings. A report
// shows the contents of a diagnosis and its figures and computes nothing; `robot` is the model that was
// diagnosed.
namespace joulecast::report {

// The stated origin of a report.
struct ReportOrigin {
  std::vector<std::string> sources;  // names of logs, tables or other sources; no paths
  std::string model;                 // name of the robot file, or the version in the daemon
  std::string made_at;               // UTC, as 2026-01-31 12:00; empty: omitted
  std::string software;              // name and version
};

// Checks, effects, the plain regression in comparison, maps, power over time, limits and origin of the data.
std::string report_html(const gap::Diagnosis& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin);
// Of a diagnosis from energies of runs.
std::string report_html(const gap::RunDiagnosis& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin);
// Of a comparison between groups.
std::string report_html(const gap::Comparison& comparison, const robot::RobotModel& robot,
                        const ReportOrigin& origin);

}  // namespace joulecast::report
