#pragma once

#include <string>

#include "client/commands/outcome.h"
#include "gap/groups/compare.h"
#include "gap/report/report.h"
#include "robot/robot_model.h"

namespace joulecast::client {

// What changes between groups of the recordings: by "prefix" or "suffix" of the missions' ids, or a label of
// theirs. `report_file`: HTML page to write; empty: none.
Exit gap_between_groups(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                        const std::string& by, bool json, const std::string& report_file,
                        const gap::ReportOrigin& origin);

// Prints a comparison and writes its page.
Exit tell(const gap::Comparison& comparison, const robot::RobotModel& robot, bool json,
          const std::string& report_file, const gap::ReportOrigin& origin);

}  // namespace joulecast::client
