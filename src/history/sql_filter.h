#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "history/sql.h"
#include "history/store.h"

// Filters of missions as SQL.
namespace joulecast::history {

// signals::energy_ratio() and signals::energy_per_distance_wh_km().
std::string ratio_sql();
std::string wh_per_km_sql();

// A condition: the mission's telemetry is not contradicted. Nothing is drawn from such missions.
inline constexpr std::string_view not_contradicted =
    "(findings_json IS NULL OR findings_json NOT LIKE '%\"contradictions\":%')";

// "column IN (?, ?, ...)" of this number of values.
std::string among(const std::string& column, std::size_t values);

// Fault::invalid on the field that is at fault.
Result<void> check_range(TimeRange range);
Result<void> check_filter(const MissionFilter& filter);

// " WHERE ..." of a filter that was checked and outlives this, which outlives the rows that it is bound to.
class Where {
 public:
  explicit Where(const MissionFilter& filter);

  const std::string& sql() const { return sql_; }
  void bind(Rows& rows) const;
  // Identifies the filter in cursors. Text values are preceded by their length, to be unambiguous.
  std::string identity() const;

 private:
  // Visits the conditions that are set, each with its parameters.
  template <class Visit>
  void visit(Visit visit) const;

  const MissionFilter& filter_;
  std::string pattern_;
  std::vector<std::string> states_;
  std::string sql_ = " WHERE TRUE";
};

// A place in an ordered result: two numbers with a meaning that depends on the query.
using CursorPlace = std::array<std::int64_t, 2>;

// `query` is any text that distinguishes queries; its fingerprint is in the cursor, which is URL-safe.
std::string encode_cursor(std::string_view query, CursorPlace place);

// Fault::invalid on field "cursor" for a malformed cursor or one of another query.
Result<CursorPlace> decode_cursor(std::string_view query, std::string_view cursor);

}  // namespace joulecast::history
