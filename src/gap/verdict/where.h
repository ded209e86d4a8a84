#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "gap/equations/channels.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// standstill, turning, acceleration, braking or cruise.
std::string_view phase_of(const Window& window, double wheel_radius_m);

// Regions of every variable in which the mean residual of battery power is surely not zero (block standard
// errors, Bonferroni over all regions looked at): those whose share of the gap exceeds their share of the
// time most come first. The residual is split by equation: what the bus shows, what the motors' voltages
// show, and what the motion's torque shows; of two channels that say the same of a region, the one that says
// more stands for both. `noise_floor`: of the power; where the gap is no larger, nothing is ranked.
std::vector<WhereRegion> localise(std::span<const Window> windows, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> adopted,
                                  std::span<const double> measured_w, std::span<const double> modelled_w,
                                  double noise_floor);

}  // namespace joulecast::gap
