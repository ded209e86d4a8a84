#pragma once

#include <span>

#include "gap/equations/channels.h"

namespace joulecast::gap {

// Largest sizes of the variables of a set of recordings, and those that were recorded.
struct Ranges {
  double mean_power_w = 1, mean_wheel_speed_rad_s = 0, payload_kg = 0;
  bool position = false, heading = false, climb = false;
};

Ranges ranges_of(std::span<const Window> windows, double mean_power_w);

}  // namespace joulecast::gap
