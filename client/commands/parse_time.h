#pragma once

#include <cstdint>
#include <string>

#include "base/error.h"
#include "client/commands/option.h"

namespace joulecast::client {

// Microseconds since the Unix epoch, from a whole number of them or from UTC as 2024-07-18T09:10:45[.5]Z; an
// error names `option`.
[[nodiscard]] Result<std::int64_t> parse_time(const std::string& text, const std::string& option);

// The exclusive end of a period; for a date alone the next midnight, so that the period includes that day.
[[nodiscard]] Result<std::int64_t> parse_end_time(const std::string& text, const std::string& option);

// A time of an option, which becomes microseconds as text by parse_time() or parse_end_time().
[[nodiscard]] Value time_value();
[[nodiscard]] Value end_time_value();

inline constexpr const char *from_help =
                                "started at or after: 2024-07-18, 2024-07-18T09:10:45Z or microseconds since "
                                "1970",
                            *to_help = "started before, the same; a day alone is in it";

}  // namespace joulecast::client
