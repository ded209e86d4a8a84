#include "history/sql_filter.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <type_traits>

#include "base/text.h"
#include "base/try.h"
#include "signals/ledger.h"

namespace joulecast::history {
namespace {

// A pattern of LIKE with the escape character '!', for lower-case texts that contain the part. Like SQL's
// lower(), it converts ASCII letters only.
std::string pattern_of(const std::string& part) {
  std::string pattern = "%";
  for (const char c : part) {
    if (c == '%' || c == '_' || c == '!') pattern += '!';
    pattern += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return pattern + "%";
}

Result<void> check_bounds(const std::string& field, const std::string& other, std::optional<double> min,
                          std::optional<double> max) {
  if ((min && std::isnan(*min)) || (max && std::isnan(*max)))
    return invalid(field, "must be a number, like " + other);
  if (min && max && *min > *max) return invalid(field, "must not be greater than " + other);
  return {};
}

constexpr std::size_t digits = 16;  // of a number

}  // namespace

std::string among(const std::string& column, std::size_t values) {
  std::string sql = column + " IN (?";
  for (std::size_t k = 1; k < values; ++k) sql += ", ?";
  return sql + ")";
}

std::string ratio_sql() {
  return "(CASE WHEN measured_s > 0 AND measured_j - ledger_unexplained_j > 0 THEN "
         "measured_j / (measured_j - ledger_unexplained_j) END)";
}

std::string wh_per_km_sql() {
  return "(CASE WHEN distance_m > " + std::to_string(signals::least_compared_distance_m) +
         " THEN battery_j / distance_m / 3.6 END)";
}

template <class Visit>
void Where::visit(Visit visit) const {
  const MissionFilter& f = filter_;
  // With a single robot the index by robot and start also provides the order.
  if (f.robot_ids.size() == 1) visit("robot_id = ?", f.robot_ids.front());
  if (f.robot_ids.size() > 1) visit(among("robot_id", f.robot_ids.size()), f.robot_ids);
  if (f.mission_id) visit("mission_id = ?", *f.mission_id);
  if (f.name_contains) visit("lower(mission_id) LIKE ? ESCAPE '!'", pattern_);
  const auto [from, to] = f.started;
  if (from != whole_past) visit("start_utime_us >= ?", from);
  if (to != whole_future) visit("start_utime_us < ?", to);
  if (!states_.empty()) visit(among("state", states_.size()), states_);
  if (f.incomplete) visit("incomplete = ?", std::int64_t{*f.incomplete});
  if (f.payload_min_kg) visit("payload_kg >= ?", *f.payload_min_kg);
  if (f.payload_max_kg) visit("payload_kg <= ?", *f.payload_max_kg);
  if (f.ratio_min) visit(ratio_sql() + " >= ?", *f.ratio_min);
  if (f.ratio_max) visit(ratio_sql() + " <= ?", *f.ratio_max);
}

Where::Where(const MissionFilter& filter) : filter_(filter) {
  if (filter.name_contains) pattern_ = pattern_of(*filter.name_contains);
  // In an order of their own and once each.
  for (std::size_t k = 0; k < mission_state_count; ++k) {
    const auto state = static_cast<MissionState>(k);
    if (std::ranges::find(filter.states, state) != filter.states.end()) states_.emplace_back(name(state));
  }
  visit([this](const std::string& condition, const auto&) { sql_ += " AND " + condition; });
}

void Where::bind(Rows& rows) const {
  visit([&rows](const std::string&, const auto& value) {
    if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::vector<std::string>>) {
      for (const std::string& one : value) rows.bind(one);
    } else {
      rows.bind(value);
    }
  });
}

std::string Where::identity() const {
  std::string text = sql_;
  const auto add = [&text](const std::string& value) {
    text += '|' + std::to_string(value.size()) + ':' + value;
  };
  visit([&](const std::string&, const auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, std::string>) {
      add(value);
    } else if constexpr (std::is_same_v<Value, std::vector<std::string>>) {
      for (const std::string& one : value) add(one);
    } else {
      text += '|' + std::to_string(std::bit_cast<std::int64_t>(value));
    }
  });
  return text;
}

Result<void> check_range(TimeRange range) {
  if (range.from_utime_us <= range.to_utime_us) return {};
  return invalid("from_utime_us", "must not be later than to_utime_us");
}

Result<void> check_filter(const MissionFilter& f) {
  if (f.robot_ids.size() > max_filter_robots)
    return invalid("robot_id", "must name at most " + std::to_string(max_filter_robots) + " robots");
  if (f.states.size() > mission_state_count) return invalid("state", "names a state more than once");
  TRY(check_range(f.started));
  TRY(check_bounds("payload_min_kg", "payload_max_kg", f.payload_min_kg, f.payload_max_kg));
  return check_bounds("ratio_min", "ratio_max", f.ratio_min, f.ratio_max);
}

std::string encode_cursor(std::string_view query, CursorPlace place) {
  const std::string numbers = fmt::format("{:016x}{:016x}", static_cast<std::uint64_t>(place[0]),
                                          static_cast<std::uint64_t>(place[1]));
  return numbers + fmt::format("{:016x}", fnv1a(numbers, fnv1a(query)));
}

Result<CursorPlace> decode_cursor(std::string_view query, std::string_view cursor) {
  CursorPlace place{};
  std::size_t at = 0;
  for (std::int64_t& number : place) {
    const std::string_view text = cursor.substr(std::min(at, cursor.size()), digits);
    std::uint64_t value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value, 16);
    number = static_cast<std::int64_t>(value);
    at += digits;
  }
  if (encode_cursor(query, place) == cursor) return place;
  return invalid("cursor",
                 "is not a cursor of this query: take it from the page before, with the same filter");
}

}  // namespace joulecast::history
