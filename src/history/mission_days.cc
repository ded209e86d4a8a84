#include "history/mission_days.h"

#include "history/sql_rows.h"

namespace joulecast::history {
namespace {

// The parts of a comma-separated text, each put into `text` at $, joined again.
std::string each(const std::string& columns, const std::string& text) {
  const std::size_t place = text.find('$');
  std::string all;
  for (const std::string& column : column_names(columns))
    all += (all.empty() ? "" : ", ") + std::string(text).replace(place, 1, column);
  return all;
}

// Rows of mission_day of the ended missions of `where`.
std::string insert_days(const std::string& where) {
  const std::string counted = " FILTER (WHERE counted)";
  const std::string day = std::to_string(day_us);
  return "INSERT INTO mission_day (robot_id, day_utime_us, stored, " + totals_columns() +
         ") SELECT robot_id, day, count(*), count(*)" + counted +
         ", count(*) FILTER (WHERE counted AND measured_s > 0), count(*) FILTER (WHERE counted AND "
         "incomplete = 1), coalesce(sum(samples)" +
         counted + ", 0), coalesce(sum(gap_count)" + counted + ", 0), " +
         each("gap_s, " + columns_of<signals::Accounts>(), "sum($)" + counted) + " FROM (SELECT *, " +
         std::string(not_annulled) + " AS counted, start_utime_us - ((start_utime_us % " + day + " + " + day +
         ") % " + day + ") AS day FROM mission WHERE state <> 'open'" + where +
         ") AS ended GROUP BY robot_id, day";
}

}  // namespace

std::int64_t day_of(std::int64_t utime_us) {
  return utime_us - ((utime_us % day_us + day_us) % day_us);
}

std::string mission_day_sql() {
  // The columns have the types of those that are summed.
  return "CREATE TABLE mission_day (robot_id, day_utime_us, stored, " + totals_columns() +
         ") AS SELECT robot_id, start_utime_us, samples, samples, samples, samples, samples, gap_count, "
         "gap_s, " +
         columns_of<signals::Accounts>() +
         " FROM mission WITH NO DATA; ALTER TABLE mission_day ADD PRIMARY KEY (robot_id, day_utime_us), ADD "
         "FOREIGN KEY (robot_id) REFERENCES robot (robot_id); CREATE INDEX mission_day_by_day ON mission_day "
         "(day_utime_us);\n";
}

std::string totals_columns() {
  return "missions, measured_missions, incomplete_missions, samples, gap_count, gap_s, " +
         columns_of<signals::Accounts>();
}

std::string totals_of_missions() {
  return "count(*), count(*) FILTER (WHERE measured_s > 0), count(*) FILTER (WHERE incomplete = 1), "
         "CAST(coalesce(sum(samples), 0) AS BIGINT), CAST(coalesce(sum(gap_count), 0) AS BIGINT), "
         "coalesce(sum(gap_s), 0.0), " +
         each(columns_of<signals::Accounts>(), "sum($)");
}

std::string totals_of_one() {
  return "1, CASE WHEN measured_s > 0 THEN 1 ELSE 0 END, incomplete, samples, gap_count, gap_s, " +
         columns_of<signals::Accounts>();
}

std::string totals_of_parts() {
  return each("missions, measured_missions, incomplete_missions, samples, gap_count",
              "CAST(coalesce(sum($), 0) AS BIGINT)") +
         ", coalesce(sum(gap_s), 0.0), " + each(columns_of<signals::Accounts>(), "sum($)");
}

void ChangedDays::changed(std::string_view robot_id, std::int64_t start_utime_us) {
  days_.emplace(robot_id, day_of(start_utime_us));
}

void ChangedDays::forget(std::string_view robot_id) {
  std::erase_if(days_, [&](const auto& day) { return day.first == robot_id; });
}

void ChangedDays::add_up(Database& database) const {
  if (!database.is_postgres()) return;
  static const std::string insert =
      insert_days(" AND robot_id = ? AND start_utime_us >= ? AND start_utime_us < ?");
  for (const auto& [robot_id, day_utime_us] : days_) {
    // Another writer that changes a mission of that robot waits, and then adds up the changed rows.
    Rows(database, "SELECT 1 FROM robot WHERE robot_id = ? FOR NO KEY UPDATE", robot_id).run_later();
    Rows(database, "DELETE FROM mission_day WHERE robot_id = ? AND day_utime_us = ?", robot_id, day_utime_us)
        .run_later();
    Rows(database, insert, robot_id, day_utime_us, day_utime_us + day_us).run_later();
  }
}

void add_up_all_days(Database& database) {
  if (!database.is_postgres()) return;
  database.execute("DELETE FROM mission_day");
  database.execute(insert_days(""));
}

}  // namespace joulecast::history
