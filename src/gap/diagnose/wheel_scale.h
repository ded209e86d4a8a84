#pragma once

#include <optional>
#include <span>

#include "gap/equations/channels.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/recording_set.h"

namespace joulecast::gap {

// A unit of the wheels' speeds with which the robot file's power agrees with the measured power of the
// windows, where it differs widely as recorded, with any base load. It has a factor if no other unit agrees
// nearly as well. For recordings in which power is the only evidence.
std::optional<Check> wheel_scale_by_power(const robot::RobotModel& robot,
                                          std::span<const dynamics::ActiveEffect> in_file,
                                          std::span<const Window> windows, std::span<const double> power_w);

// The same of recordings, before any diagnosis.
std::optional<Check> wheel_scale_by_power(const robot::RobotModel& robot,
                                          const telemetry::RecordingSet& recordings);

}  // namespace joulecast::gap
