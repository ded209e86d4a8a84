#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/error.h"

namespace joulecast::report {

// The motion of a profile or estimate, with its baselines, over time, as an SVG document: speed where one
// drives, yaw rate where one turns, power and energy. Fault::corrupt where the answer has no columns.
[[nodiscard]] Result<std::string> draw_answer(const nlohmann::json& answer);

// Round values that span a range.
std::vector<double> ticks_of(double low, double high, int about);

}  // namespace joulecast::report
