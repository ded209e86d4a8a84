#pragma once

#include <string>

#include "gap/report/report.h"
#include "gap/runs/diagnose_runs.h"

namespace joulecast::gap {

// A diagnosis of runs as one HTML page.
std::string report_html(const RunDiagnosis& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin);

}  // namespace joulecast::gap
