#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "gap/equations/channels.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Returns standstill, turning, acceleration, braking or cruise.
std::string_view phase_of(const Window& window, double wheel_radius_m);

// Returns the regions of every variable in which the mean residual of battery power differs significantly
// from zero (block standard errors, Bonferroni), sorted by the excess of their share of the gap over that of
// the time. The residual is split by equation; the one with the larger share represents a region. Empty where
// the gap is no larger than `noise_floor`, of the power.
std::vector<WhereRegion> localise(std::span<const Window> windows, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> adopted,
                                  std::span<const double> measured_w, std::span<const double> modelled_w,
                                  double noise_floor);

}  // namespace joulecast::gap
