#pragma once

#include <string>

#include "gap/groups/compare.h"
#include "gap/report/report.h"

namespace joulecast::gap {

// A comparison as one HTML page.
std::string report_html(const Comparison& comparison, const robot::RobotModel& robot,
                        const ReportOrigin& origin);

}  // namespace joulecast::gap
