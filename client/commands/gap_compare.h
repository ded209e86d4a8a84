#pragma once

#include <functional>
#include <string>

#include "client/commands/outcome.h"
#include "gap/groups/compare.h"
#include "report/report.h"
#include "robot/robot_model.h"

namespace joulecast::client {

struct GapCompareOptions {
  std::string by;  // "prefix" or "suffix" of the missions' ids, or a label of theirs
  bool json = false;
  std::string report;  // HTML file to write; empty: none
  bool force = false;  // write over it
};

// What changes between groups of the recordings.
Exit gap_between_groups(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                        const GapCompareOptions& options, const report::ReportOrigin& origin);

// Makes a comparison, prints it and writes its page.
Exit compare_and_print(const std::function<Result<gap::Comparison>(const gap::CompareSettings&)>& compare,
                       const robot::RobotModel& robot, const GapCompareOptions& options,
                       const report::ReportOrigin& origin);

}  // namespace joulecast::client
