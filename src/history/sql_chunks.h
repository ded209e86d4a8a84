#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/commands.h"
#include "history/sql.h"
#include "history/store.h"

// Raw telemetry and covariates as SQL: two tables of one shape (schemas/store.sql). They throw SqlError.
namespace joulecast::history::chunks {

// Samples or changes of a sealed chunk: enough to compress well, few enough to decode in under 1 ms.
inline constexpr std::size_t sealed_items = 1024;

// Where a mission's next samples or changes go.
struct End {
  MissionKey key = 0;
  std::int64_t next_ordinal = 0;
  std::int64_t in_tail = 0;  // of items that are not sealed
  // Collects chunks that are not sealed, of the columns of telemetry_columns(); null: they are stored now.
  Statement* collected = nullptr;
};

// The columns that a chunk of telemetry is stored with, the key first.
std::string telemetry_columns();

// How many samples and changes of a row of `mission` are in its tails: two columns.
std::string in_tails_sql();

// Appends to the mission's unsealed tail and seals it in full chunks, or all of it when the mission has
// ended. The mission's row counts them already. Answers how many are in the tail then.
template <class Item>
std::int64_t append(Database& database, const End& end, const std::vector<Item>& items, bool ended,
                    std::int64_t now_utime_us);

// Deletes the trace and the chunks of a mission that was deleted.
void drop_recordings(Database& database, MissionKey key);

// As Store::telemetry() and Store::covariates(); the mission must exist.
template <class Item>
Result<ItemPage<Item>> read_page(Database& database, MissionKey key, TimeRange range,
                                 const PageRequest& page);

std::int64_t encoded_bytes(Database& database);
std::int64_t count(Database& database);

// Drops chunks beyond the retention, oldest first, at most `max_chunks`; returns their number.
std::int64_t prune(Database& database, const Retention& keep, std::int64_t max_chunks,
                   std::int64_t now_utime_us);

}  // namespace joulecast::history::chunks
