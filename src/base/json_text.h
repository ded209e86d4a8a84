#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "base/error.h"

namespace joulecast {

// Strict JSON: one value, UTF-8, no repeated keys in an object, no nesting deeper than `max_depth`.
// An error's field: the JSON pointer of the object with a repeated key, else empty; its message: the byte.
Result<nlohmann::json> parse_json(std::string_view text, std::size_t max_depth = 64);

}  // namespace joulecast
