#pragma once

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/resolution.h"

namespace joulecast {

// A number of an answer that may be unknown: null where it is not finite. For .cc files alone; other headers
// take json_fwd.hpp.
inline nlohmann::json json_number(double value) {
  return std::isfinite(value) ? nlohmann::json(resolved(value)) : nlohmann::json(nullptr);
}

// The ends of an interval, lower first.
inline nlohmann::json json_interval(const std::array<double, 2>& ends) {
  return nlohmann::json::array({json_number(ends[0]), json_number(ends[1])});
}

}  // namespace joulecast
