#pragma once

#include <optional>
#include <span>

#include "gap/checks/check.h"
#include "gap/equations/channels.h"

namespace joulecast::gap {

// A unit of the wheels' speeds with which the robot file asks for the power that was measured, where as
// recorded it asks for something else altogether (`gap`, of the power). For recordings without motor
// channels, in which nothing but the power says how fast the wheels turn. `power_w`: measured, of the
// windows.
std::optional<Check> wheel_scale_by_power(const robot::RobotModel& robot,
                                          std::span<const dynamics::ActiveEffect> in_file,
                                          std::span<const Window> windows, std::span<const double> power_w,
                                          double gap);

}  // namespace joulecast::gap
