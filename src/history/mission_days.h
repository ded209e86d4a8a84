#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "history/sql.h"

// Sums over missions, and the table mission_day, which only a PostgreSQL has. It contains those of a robot's
// ended missions of a day of UTC, recomputed in the transaction that changes one of them. Annulled missions
// count in `stored` alone.
namespace joulecast::history {

inline constexpr std::int64_t day_us = 86'400'000'000;

// The midnight of UTC at or before the time; also before 1970.
std::int64_t day_of(std::int64_t utime_us);

// Creates the table mission_day in a PostgreSQL.
std::string mission_day_sql();

// SQL condition: the mission was not annulled. Annulled missions are excluded from all sums. In findings, as
// annulled_findings() writes them, only the names of members have quotes without a backslash.
inline constexpr std::string_view not_annulled =
    "(findings_json IS NULL OR findings_json NOT LIKE '%\"annulled\":%')";

// The SQL of Totals, each time comma-separated and in the order of Totals: the columns of mission_day; sums
// over missions; the values of one mission; sums over rows of such columns.
std::string totals_columns();
std::string totals_of_missions();
std::string totals_of_one();
std::string totals_of_parts();

// The robots and days with missions that a transaction changes.
class ChangedDays {
 public:
  void clear() { days_.clear(); }
  // A mission of the robot that started at that time was stored, changed or deleted.
  void changed(std::string_view robot_id, std::int64_t start_utime_us);
  // The robot is deleted.
  void forget(std::string_view robot_id);
  // Recomputes their rows, in the same transaction; does nothing where there is no such table.
  void add_up(Database& database) const;

 private:
  std::set<std::pair<std::string, std::int64_t>> days_;
};

// Recomputes all rows.
void add_up_all_days(Database& database);

}  // namespace joulecast::history
