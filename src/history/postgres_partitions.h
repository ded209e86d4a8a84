#pragma once

#include <cstdint>
#include <string_view>

#include "history/commands.h"
#include "history/sql.h"

// Partitions by time of the tables of schemas/store_by_robot.postgresql.sql. A partition is called after its
// table and the day of UTC on which it begins, as in telemetry_chunk_20260131. All throw SqlError.
namespace joulecast::history {

// How far ahead of need partitions are made, at least.
inline constexpr std::int64_t partitions_ahead_us = 3 * std::int64_t{86'400'000'000};

// Creates the missing partitions from the time on to partitions_ahead_us later, in a transaction of its own;
// rows stored meanwhile without a partition are moved in. Several programs may do so at the same time. Waits
// at most 2 s for readers and writers of the tables: SqlError::Kind::unavailable then, and nothing is lost,
// since rows without a partition are stored all the same.
void make_partitions(Database& database, std::int64_t now_utime_us);

// The same for rows with times from the first to the last one, within the caller's transaction. Not for times
// before 1970 or after 2099, nor for more than 1000 partitions.
void make_partitions(Database& database, std::string_view table, std::int64_t first_utime_us,
                     std::int64_t last_utime_us);

// The time before which chunks were stored that are older than `max_age_us`: where that is a week or more,
// the beginning of a day, for chunks to go with their partition.
std::int64_t past_chunks_utime_us(std::int64_t now_utime_us, std::int64_t max_age_us);

// Drops partitions of chunks that are past as a whole, oldest first, with at most `max_chunks` chunks;
// returns the number of dropped chunks. In a transaction of its own, which waits at most 1 s for readers of
// the tables.
std::int64_t drop_past_chunks(Database& database, const Prune& prune, std::int64_t now_utime_us);

// Deletes missions that ended longer ago than their age, by whole weeks of such missions with the partition
// of their traces; at most as many as the command allows; returns how many. Transaction and wait as
// drop_past_chunks().
std::int64_t drop_past_traces(Database& database, const PruneMissions& prune, std::int64_t now_utime_us);

}  // namespace joulecast::history
