#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "telemetry/import_mapping.h"

// Cells of a table to numbers and times. Only the import's own sources use this.
namespace joulecast::telemetry {

inline constexpr std::int64_t latest_import_utime_us = 4'102'444'800'000'000;  // the year 2100

// Empty for anything but one number; "nan" and "inf" are numbers.
[[nodiscard]] std::optional<double> parse_number(std::string_view text, bool decimal_comma);

// What to write into the mapping where a cell that is refused has a decimal comma; else empty.
[[nodiscard]] std::string decimal_hint(std::string_view text, const TableLayout& layout);

// Time since the column's zero in us; of ISO 8601 since 1970. Whole numbers stay exact: ns since 1970 do not
// fit a double.
[[nodiscard]] std::optional<std::int64_t> parse_time_us(std::string_view text, const TableLayout& layout);

}  // namespace joulecast::telemetry
