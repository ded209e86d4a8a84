#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/error.h"

namespace joulecast::client {

// A picture of a profile or estimate answer: the plan against the trapezoid and the triangle as far as the
// answer has their columns. Fault::corrupt when it has no columns at all.
[[nodiscard]] Result<std::string> draw_answer(const nlohmann::json& answer);

}  // namespace joulecast::client
