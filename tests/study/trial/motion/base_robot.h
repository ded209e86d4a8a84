#pragma once

#include <span>

#include "tests/study/trial/motion/base_power.h"

namespace joulecast::trial::motion {

// The robot file with the base power as its model: idle power, friction, scrub, mass and drag are its
// coefficients, copper takes a two-thousandth of the power. Wheels, payload and battery are the log's.
[[nodiscard]] robot::RobotModel base_robot(const MotionLog& log, const BaseForm& form, const Terms& base);

// Battery power of such a file at an instant, by formulas of the trial's own [W].
[[nodiscard]] double file_power_w(const robot::RobotModel& file, const Instant& at);

// Mean absolute difference between the file's power and the base power, over the mean absolute base power.
[[nodiscard]] double base_mismatch(const robot::RobotModel& file, const BaseForm& form, const Terms& base,
                                   std::span<const Instant> instants);

}  // namespace joulecast::trial::motion
