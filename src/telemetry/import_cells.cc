#include "telemetry/import_cells.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

#include "base/utc_time.h"

namespace joulecast::telemetry {
namespace {

std::optional<std::int64_t> parse_iso_us(std::string_view text, const TableLayout& layout) {
  std::string stamp(text);
  std::ranges::replace(stamp, ',', '.');
  if (const std::size_t blank = stamp.find(' '); blank == 10) stamp[blank] = 'T';
  if (const auto time = parse_utc(stamp); time && stamp.size() > 10) return time;
  if (layout.utc_offset.empty()) return std::nullopt;
  return parse_utc(stamp + layout.utc_offset);
}

}  // namespace

std::optional<double> parse_number(std::string_view text, bool decimal_comma) {
  std::string with_point;
  if (decimal_comma) {
    // A point would be one of thousands, or a mistake.
    if (text.find('.') != std::string_view::npos) return std::nullopt;
    with_point = text;
    std::ranges::replace(with_point, ',', '.');
    text = with_point;
  }
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string decimal_hint(std::string_view text, const TableLayout& layout) {
  const bool comma = !layout.decimal_comma && text.find(',') != std::string_view::npos;
  return comma && parse_number(text, true) ? R"(; a decimal comma needs "decimal": ",")" : "";
}

std::optional<std::int64_t> parse_time_us(std::string_view text, const TableLayout& layout) {
  const std::int64_t unit_ns = layout.time_unit_ns;
  if (unit_ns == 0) return parse_iso_us(text, layout);
  std::int64_t whole = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), whole);
  if (fault == std::errc{} && end == text.data() + text.size()) {
    if (unit_ns < 1000) return whole / (1000 / unit_ns);
    std::int64_t scaled = 0;
    if (__builtin_mul_overflow(whole, unit_ns / 1000, &scaled)) return std::nullopt;
    return scaled;
  }
  const auto real = parse_number(text, layout.decimal_comma);
  if (!real) return std::nullopt;
  const double us = *real * static_cast<double>(unit_ns) / 1000;
  if (!(std::abs(us) <= static_cast<double>(latest_import_utime_us))) return std::nullopt;
  return std::llround(us);
}

}  // namespace joulecast::telemetry
