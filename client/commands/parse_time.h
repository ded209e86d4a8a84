#pragma once

#include <cstdint>
#include <string>

#include "base/error.h"

namespace joulecast::client {

// Microseconds since the Unix epoch, from a whole number of them or from UTC as 2024-07-18T09:10:45[.5]Z; an
// error names `option`.
[[nodiscard]] Result<std::int64_t> parse_time(const std::string& text, const std::string& option);

// The exclusive end of a period; for a date alone the next midnight, so that the period includes that day.
[[nodiscard]] Result<std::int64_t> parse_end_time(const std::string& text, const std::string& option);

}  // namespace joulecast::client
