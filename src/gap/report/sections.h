#pragma once

#include <span>

#include "gap/report/page.h"
#include "gap/report/report.h"

// The sections of reports. Each leaves itself out where a diagnosis has nothing for it.
namespace joulecast::gap {

// Of any report:

// The effects found, each with what it means, how strong and how sure it is, what it cannot be told from and
// what to check in the workshop. `mean_power_w` stands beside the power that each moves; 0: not said.
void effects_section(Page& page, std::span<const DiagnosedEffect> effects, double mean_power_w = 0);
void origin_section(Page& page, const ReportOrigin& origin, const robot::RobotModel& robot);

// Of a report on recordings:

void checks_section(Page& page, std::span<const Check> checks);
void outside_card(Page& page, const Outside& outside);
// What would fit in the robot file, and what it may or may not take over.
void adoption_section(Page& page, const Diagnosis& diagnosis);
// Errors on held-out parts beside those of a plain regression, and what each effect closes.
void held_out_section(Page& page, const Diagnosis& diagnosis);
void channels_section(Page& page, std::span<const ChannelGap> channels);
void where_section(Page& page, const Diagnosis& diagnosis);
void floor_section(Page& page, const Diagnosis& diagnosis);
void power_section(Page& page, const Diagnosis& diagnosis);
void next_drive_section(Page& page, std::span<const NextDrive> drives);
void missions_section(Page& page, const Diagnosis& diagnosis);

}  // namespace joulecast::gap
