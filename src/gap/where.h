#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "gap/diagnosis.h"
#include "gap/windows.h"

namespace joulecast::gap {

// standstill, turning, acceleration, braking or cruise.
std::string_view phase_of(const Window& window, double wheel_radius_m);

// Regions of every variable in which the mean residual of battery power is surely not zero (block standard
// errors, Bonferroni over all regions looked at), largest share first. The residual is split by equation:
// what the bus shows, what the motors' voltages show, and what the motion's torque shows.
std::vector<WhereRegion> localise(std::span<const Window> windows, const robot::RobotModel& robot,
                                  std::span<const double> modelled_w);

}  // namespace joulecast::gap
