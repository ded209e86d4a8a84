#pragma once

#include <span>

#include "gap/equations/channels.h"

namespace joulecast::gap {

// Whether any voltage of a motor was read.
bool voltages_read(std::span<const Window> windows);

// One motor's voltage in a window [V]: as it was read, or as the file's winding needs it for the current and
// the speed. NaN where neither is available.
double motor_voltage(const Window& w, const robot::RobotModel& robot, std::size_t side);

// Power of both motors in a window [W]; where no motor's voltage was read at all (`volts_read` false) by the
// voltages that the file's windings need. NaN without both currents.
double motors_power(const Window& w, const robot::RobotModel& robot, bool volts_read);

}  // namespace joulecast::gap
