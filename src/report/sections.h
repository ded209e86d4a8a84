#pragma once

#include <span>

#include "report/page.h"
#include "report/report.h"

// The sections of reports. Each is omitted where a diagnosis has no content for it.
namespace joulecast::report {

// Of any report:

// The effects found, each with its meaning, strength and certainty, its alternatives that the data do not
// exclude, and the points to check in the workshop. `mean_power_w` is shown with the power of each; 0:
// omitted.
void effects_section(Page& page, std::span<const gap::DiagnosedEffect> effects, double mean_power_w = 0);
void origin_section(Page& page, const ReportOrigin& origin, const robot::RobotModel& robot);

// Of a report on recordings:

void checks_section(Page& page, std::span<const gap::Check> checks);
void outside_card(Page& page, const gap::Outside& outside);
// Values that would fit in the robot file, and those that may or may not be adopted.
void adoption_section(Page& page, const gap::Diagnosis& diagnosis);
// Errors on held-out parts compared with those of a plain regression, and the share that each effect closes.
void held_out_section(Page& page, const gap::Diagnosis& diagnosis);
void channels_section(Page& page, std::span<const gap::ChannelGap> channels);
void where_section(Page& page, const gap::Diagnosis& diagnosis);
void floor_section(Page& page, const gap::Diagnosis& diagnosis);
void power_section(Page& page, const gap::Diagnosis& diagnosis);
void next_drive_section(Page& page, std::span<const gap::NextDrive> drives);
void missions_section(Page& page, const gap::Diagnosis& diagnosis);

}  // namespace joulecast::report
