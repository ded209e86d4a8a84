#pragma once

#include <optional>
#include <span>

#include "gap/equations/channels.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// A unit of the wheels' speeds that makes the robot file's power agree with the measured power, where it
// differs widely with the speeds as recorded, with any base load in both. For recordings without motor
// channels, in which power is the only evidence on the speed of the wheels. `power_w`: measured, of the
// windows.
std::optional<Check> wheel_scale_by_power(const robot::RobotModel& robot,
                                          std::span<const dynamics::ActiveEffect> in_file,
                                          std::span<const Window> windows, std::span<const double> power_w);

}  // namespace joulecast::gap
