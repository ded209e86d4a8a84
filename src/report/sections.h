#pragma once

#include <span>

#include "report/page.h"
#include "report/report.h"

// The sections of reports. Each leaves itself out where a diagnosis has nothing for it.
namespace joulecast::report {

// Of any report:

// The effects found, each with what it means, how strong and how sure it is, what it cannot be distinguished
// from and what to check in the workshop. `mean_power_w` stands beside the power that each moves; 0: not
// said.
void effects_section(Page& page, std::span<const gap::DiagnosedEffect> effects, double mean_power_w = 0);
void origin_section(Page& page, const ReportOrigin& origin, const robot::RobotModel& robot);

// Of a report on recordings:

void checks_section(Page& page, std::span<const gap::Check> checks);
void outside_card(Page& page, const gap::Outside& outside);
// What would fit in the robot file, and what it may or may not take over.
void adoption_section(Page& page, const gap::Diagnosis& diagnosis);
// Errors on held-out parts beside those of a plain regression, and what each effect closes.
void held_out_section(Page& page, const gap::Diagnosis& diagnosis);
void channels_section(Page& page, std::span<const gap::ChannelGap> channels);
void where_section(Page& page, const gap::Diagnosis& diagnosis);
void floor_section(Page& page, const gap::Diagnosis& diagnosis);
void power_section(Page& page, const gap::Diagnosis& diagnosis);
void next_drive_section(Page& page, std::span<const gap::NextDrive> drives);
void missions_section(Page& page, const gap::Diagnosis& diagnosis);

}  // namespace joulecast::report
