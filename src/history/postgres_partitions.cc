#include "history/postgres_partitions.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "history/mission_days.h"
#include "history/sql_chunks.h"

namespace joulecast::history {
namespace {

constexpr std::int64_t week_us = 7 * day_us;
constexpr std::int64_t first_of_any_utime_us = 0, end_of_all_utime_us = 4'102'444'800'000'000;  // 2100
constexpr std::int64_t most_at_once = 1000;
constexpr const char* one_at_a_time = "SELECT pg_advisory_xact_lock(1246512982, hashtext(current_schema()))";

struct PartitionedTable {
  std::string_view name, time;  // the column that rows are parted by
  std::int64_t width_us;
  bool of_chunks;
};

constexpr std::array partitioned_tables = {
    PartitionedTable{"trace", "start_utime_us", week_us, false},
    PartitionedTable{"telemetry_chunk", "stored_utime_us", day_us, true},
    PartitionedTable{"covariate_chunk", "stored_utime_us", week_us, true}};

struct Partition {
  std::string name;
  std::int64_t from_utime_us = 0, to_utime_us = 0;
};

std::string name_of(const PartitionedTable& table, std::int64_t from_utime_us) {
  const std::chrono::year_month_day day{
      std::chrono::sys_days(std::chrono::days(static_cast<int>(from_utime_us / day_us)))};
  const auto two = [](unsigned number) { return (number < 10 ? "0" : "") + std::to_string(number); };
  return std::string(table.name) + '_' + std::to_string(static_cast<int>(day.year())) +
         two(static_cast<unsigned>(day.month())) + two(static_cast<unsigned>(day.day()));
}

// Those with a beginning and an end, oldest first.
std::vector<Partition> partitions_of(Database& database, const PartitionedTable& table) {
  Rows rows(database.statement(
      "SELECT relname::text, bounds[1]::bigint, bounds[2]::bigint FROM (SELECT relname, "
      "regexp_match(pg_get_expr(relpartbound, oid), '''([0-9]+)''\\) TO \\(.*''([0-9]+)''\\)') AS bounds "
      "FROM pg_class JOIN pg_inherits ON inhrelid = oid WHERE inhparent = to_regclass(?)) AS each WHERE "
      "bounds "
      "IS NOT NULL ORDER BY 2"));
  rows.bind(table.name);
  std::vector<Partition> all;
  while (rows.next()) {
    Partition& one = all.emplace_back();
    one.name = rows.text();
    one.from_utime_us = rows.integer();
    one.to_utime_us = rows.integer();
  }
  return all;
}

// As an empty table that becomes a partition, so that readers of the other partitions do not wait.
void make(Database& database, const PartitionedTable& table, std::int64_t from_utime_us) {
  const std::string parent(table.name), other = parent + "_other", name = name_of(table, from_utime_us);
  const std::string time(table.time), from = std::to_string(from_utime_us),
                                      to = std::to_string(from_utime_us + table.width_us);
  const std::string prefix = table.of_chunks ? "1, " : "";
  database.execute("CREATE TABLE " + name + " (LIKE " + parent +
                   " INCLUDING DEFAULTS INCLUDING CONSTRAINTS INCLUDING STORAGE)");
  database.execute("LOCK TABLE " + other + " IN ACCESS EXCLUSIVE MODE");
  database.execute("WITH moved AS (DELETE FROM " + other + " WHERE " + time + " >= " + from + " AND " + time +
                   " < " + to + (table.of_chunks ? " AND sealed = 1" : "") + " RETURNING *) INSERT INTO " +
                   name + " SELECT * FROM moved");
  database.execute("ALTER TABLE " + parent + " ATTACH PARTITION " + name + " FOR VALUES FROM (" + prefix +
                   from + ") TO (" + prefix + to + ")");
}

void make_missing(Database& database, const PartitionedTable& table, std::int64_t first_utime_us,
                  std::int64_t last_utime_us) {
  const std::int64_t first = floor_to(std::max(first_utime_us, first_of_any_utime_us), table.width_us);
  const std::int64_t last = std::min(last_utime_us, end_of_all_utime_us - 1);
  if (first > last || (last - first) / table.width_us >= most_at_once) return;
  const std::vector<Partition> there = partitions_of(database, table);
  for (std::int64_t from = first; from <= last; from += table.width_us)
    if (std::ranges::none_of(there, [&](const Partition& p) { return p.from_utime_us == from; }))
      make(database, table, from);
}

bool misses_any(Database& database, std::int64_t now_utime_us, std::int64_t until_utime_us) {
  return std::ranges::any_of(partitioned_tables, [&](const PartitionedTable& table) {
    const std::vector<Partition> there = partitions_of(database, table);
    for (std::int64_t from = floor_to(now_utime_us, table.width_us); from <= until_utime_us;
         from += table.width_us)
      if (std::ranges::none_of(there, [&](const Partition& p) { return p.from_utime_us == from; }))
        return true;
    return false;
  });
}

std::int64_t count(Database& database, const std::string& sql) {
  return database.integer("SELECT count(*) FROM " + sql);
}

}  // namespace

void make_partitions(Database& database, std::int64_t now_utime_us) {
  const std::int64_t until_utime_us = now_utime_us + partitions_ahead_us;
  if (now_utime_us < first_of_any_utime_us || until_utime_us >= end_of_all_utime_us) return;
  if (!misses_any(database, now_utime_us, until_utime_us)) return;
  Transaction transaction(database, Database::Access::write);
  database.execute("SET LOCAL lock_timeout = '2s'");
  database.execute(one_at_a_time);
  for (const PartitionedTable& table : partitioned_tables)
    make_missing(database, table, now_utime_us, until_utime_us);
  transaction.commit();
}

void make_partitions(Database& database, std::string_view table, std::int64_t first_utime_us,
                     std::int64_t last_utime_us) {
  const auto found = std::ranges::find(partitioned_tables, table, &PartitionedTable::name);
  if (found != partitioned_tables.end()) make_missing(database, *found, first_utime_us, last_utime_us);
}

std::int64_t past_chunks_utime_us(std::int64_t now_utime_us, std::int64_t max_age_us) {
  const std::int64_t past_utime_us = now_utime_us - max_age_us;
  return max_age_us >= week_us ? floor_to(past_utime_us, day_us) : past_utime_us;
}

std::int64_t drop_past_chunks(Database& database, const Prune& prune, std::int64_t now_utime_us) {
  if (!prune.retention.telemetry_max_age_us) return 0;
  const std::int64_t past_utime_us =
      past_chunks_utime_us(now_utime_us, *prune.retention.telemetry_max_age_us);
  std::int64_t dropped = 0;
  Transaction transaction(database, Database::Access::write);
  database.execute("SET LOCAL lock_timeout = '1s'");
  for (const PartitionedTable& table : partitioned_tables) {
    if (!table.of_chunks) continue;
    for (const Partition& partition : partitions_of(database, table)) {
      if (partition.to_utime_us > past_utime_us) break;
      const std::int64_t chunks = count(database, partition.name);
      if (dropped + chunks > prune.max_chunks) break;
      database.execute("DROP TABLE " + partition.name);
      dropped += chunks;
    }
  }
  transaction.commit();
  return dropped;
}

std::int64_t drop_past_traces(Database& database, const PruneMissions& prune, std::int64_t now_utime_us) {
  const std::int64_t past_utime_us = now_utime_us - prune.max_age_us;
  std::int64_t dropped = 0;
  Transaction transaction(database, Database::Access::write);
  database.execute("SET LOCAL lock_timeout = '1s'");
  ChangedDays days;
  std::vector<std::pair<std::string, MissionKey>> deleted;
  for (const Partition& partition : partitions_of(database, partitioned_tables[0])) {
    if (partition.to_utime_us > past_utime_us) break;
    // A mission's trace begins no earlier than the mission does.
    const std::string begun = "mission WHERE start_utime_us < " + std::to_string(partition.to_utime_us);
    const std::string living =
        " AND (state = 'open' OR end_utime_us >= " + std::to_string(past_utime_us) + ")";
    const std::int64_t missions = count(database, begun);
    if (dropped + missions > prune.max_missions || count(database, begun + living) > 0) break;
    database.execute("DROP TABLE " + partition.name);
    const auto remove =
        database.prepare("DELETE FROM " + begun + " RETURNING robot_id, mission_key, start_utime_us");
    for (Rows rows(*remove); rows.next(); ++dropped) {
      const std::string robot_id = rows.text();
      deleted.emplace_back(robot_id, rows.integer());
      days.changed(robot_id, rows.integer());
    }
  }
  for (const auto& [robot_id, key] : deleted) chunks::drop_recordings(database, robot_id, key);
  days.add_up(database);
  transaction.commit();
  return dropped;
}

}  // namespace joulecast::history
