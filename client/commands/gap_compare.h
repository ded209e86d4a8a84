#pragma once

#include <string>
#include <vector>

#include "client/commands/outcome.h"
#include "telemetry/recording_set.h"
#include "gap/report.h"
#include "robot/robot_model.h"

namespace joulecast::client {

// What changes between groups of the recordings; `by` is "prefix" or "suffix" of the missions' ids.
// `report_file`: HTML page to write; empty: none.
Exit gap_between_groups(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                        const std::string& by, bool json, const std::string& report_file,
                        const gap::ReportOrigin& origin);

}  // namespace joulecast::client
