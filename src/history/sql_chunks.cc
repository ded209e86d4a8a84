#include "history/sql_chunks.h"

#include <algorithm>
#include <utility>

#include "base/try.h"
#include "history/chunk_codec.h"
#include "history/sql_filter.h"

namespace joulecast::history::chunks {
namespace {

using signals::CovariateChange;
using signals::Sample;

// Chunks read by one query, so that a page of a long mission does not bring all of it; more than one.
constexpr std::int64_t chunks_at_once = 64;

// zstd levels: a tail chunk is soon written again, a sealed one is kept.
constexpr int tail_level = 1;
constexpr int sealed_level = 3;

// One of the two tables: its name, the column that counts a chunk's items, and its chunks' codec.
template <class Item>
struct Table;

template <>
struct Table<Sample> {
  static constexpr const char* name = "telemetry_chunk";
  static constexpr const char* items = "samples";
  static auto encode(std::span<const Sample> samples, int level) { return encode_chunk(samples, level); }
  static auto decode(std::span<const std::byte> bytes) { return decode_chunk(bytes); }
};

template <>
struct Table<CovariateChange> {
  static constexpr const char* name = "covariate_chunk";
  static constexpr const char* items = "changes";
  static auto encode(std::span<const CovariateChange> changes, int level) {
    return encode_covariates(changes, level);
  }
  static auto decode(std::span<const std::byte> bytes) { return decode_covariates(bytes); }
};

std::string chunk_columns(std::string_view items) {
  return std::string("mission_key, first_ordinal, ")
      .append(items)
      .append(", start_utime_us, end_utime_us, stored_utime_us, sealed, bytes, body");
}

// The text with the table's names in it: $table, $items.
template <class Item>
std::string sql_of(std::string text) {
  for (const auto& [place, name] :
       {std::pair<std::string, std::string>{"$table", Table<Item>::name}, {"$items", Table<Item>::items}}) {
    for (std::size_t at = 0; (at = text.find(place, at)) != std::string::npos; at += name.size())
      text.replace(at, place.size(), name);
  }
  return text;
}

template <class Item>
void insert_chunk(Database& database, const End& mission, std::int64_t first_ordinal,
                  std::span<const Item> items, bool sealed, std::int64_t now_utime_us) {
  const auto [first, last] = std::minmax_element(
      items.begin(), items.end(), [](const Item& a, const Item& b) { return a.utime_us < b.utime_us; });
  const std::vector<std::byte> body = Table<Item>::encode(items, sealed ? sealed_level : tail_level);
  static const std::string sql = insert_into(Table<Item>::name, chunk_columns(Table<Item>::items));
  Rows rows(!sealed && mission.collected != nullptr ? *mission.collected : database.statement(sql));
  rows.bind(mission.key)
      .bind(first_ordinal)
      .bind(static_cast<std::int64_t>(items.size()))
      .bind(first->utime_us)
      .bind(last->utime_us)
      .bind(now_utime_us)
      .bind(sealed)
      .bind(static_cast<std::int64_t>(body.size()))
      .bind(std::span<const std::byte>(body))
      .run_later();
}

template <class Item>
std::vector<Item> take_tail(Database& database, MissionKey key) {
  static const std::string select =
      sql_of<Item>("SELECT body FROM $table WHERE mission_key = ? AND sealed = 0 ORDER BY first_ordinal");
  static const std::string seal =
      sql_of<Item>("UPDATE $table SET sealed = 1 WHERE mission_key = ? AND sealed = 0");
  static const std::string drop = sql_of<Item>("DELETE FROM $table WHERE mission_key = ? AND sealed = 0");
  std::vector<Item> all;
  bool readable = true;
  {
    Rows rows(database, select, key);
    while (readable && rows.next()) {
      const auto items = Table<Item>::decode(rows.blob());
      readable = items.has_value();
      if (readable) all.insert(all.end(), items->begin(), items->end());
    }
  }
  // Damaged on disk: sealed for the reader to report, so that later items go to new chunks.
  Rows(database, readable ? drop : seal, key).run_later();
  if (!readable) all.clear();
  return all;
}

template <class Item>
std::string in_tail_sql() {
  return sql_of<Item>(
      "(SELECT CAST(coalesce(sum($items), 0) AS BIGINT) FROM $table AS tail WHERE tail.mission_key = "
      "mission.mission_key AND tail.sealed = 0)");
}

}  // namespace

std::string in_tails_sql() {
  return in_tail_sql<Sample>() + ", " + in_tail_sql<CovariateChange>();
}

std::string telemetry_columns() {
  return chunk_columns(Table<Sample>::items);
}

template <class Item>
std::int64_t append(Database& database, const End& end, const std::vector<Item>& items, bool ended,
                    std::int64_t now_utime_us) {
  if (items.empty() && (!ended || end.in_tail == 0)) return end.in_tail;
  const std::size_t unsealed = static_cast<std::size_t>(end.in_tail) + items.size();
  if (!ended && unsealed < sealed_items) {
    insert_chunk<Item>(database, end, end.next_ordinal, items, false, now_utime_us);
    return static_cast<std::int64_t>(unsealed);
  }
  std::vector<Item> all;
  if (end.in_tail > 0) all = take_tail<Item>(database, end.key);
  std::int64_t ordinal = end.next_ordinal - static_cast<std::int64_t>(all.size());
  all.insert(all.end(), items.begin(), items.end());
  for (std::span<const Item> rest = all; !rest.empty();) {
    const auto piece = rest.first(std::min(rest.size(), sealed_items));
    insert_chunk<Item>(database, end, ordinal, piece, ended || piece.size() == sealed_items, now_utime_us);
    ordinal += static_cast<std::int64_t>(piece.size());
    rest = rest.subspan(piece.size());
  }
  return ended ? 0 : static_cast<std::int64_t>(all.size() % sealed_items);
}

template <class Item>
Result<ItemPage<Item>> read_page(Database& database, MissionKey key, TimeRange range,
                                 const PageRequest& page) {
  ItemPage<Item> found;
  const std::string query = std::string(Table<Item>::name) + '|' + std::to_string(key) + '|' +
                            std::to_string(range.from_utime_us) + '|' + std::to_string(range.to_utime_us);
  std::int64_t from_ordinal = 0;
  if (!page.cursor.empty()) {
    TRY_ASSIGN(const auto place, decode_cursor(query, page.cursor));
    from_ordinal = place[0];
  }
  static const std::string select = sql_of<Item>(
      "SELECT first_ordinal, body FROM $table WHERE mission_key = ?1 AND first_ordinal >= coalesce((SELECT "
      "max(first_ordinal) FROM $table WHERE mission_key = ?1 AND first_ordinal <= ?2), 0) AND end_utime_us "
      ">= ?3 AND start_utime_us < ?4 ORDER BY first_ordinal LIMIT ?5");
  for (;;) {
    Rows rows(database, select, key, from_ordinal, range.from_utime_us, range.to_utime_us, chunks_at_once);
    std::int64_t chunks = 0, ordinal = from_ordinal;
    for (; rows.next(); ++chunks) {
      ordinal = rows.integer();
      TRY_ASSIGN(const auto items, Table<Item>::decode(rows.blob()));
      for (const Item& item : items) {
        const std::int64_t at = ordinal++;
        if (at < from_ordinal || item.utime_us < range.from_utime_us || item.utime_us >= range.to_utime_us)
          continue;
        if (static_cast<std::int64_t>(found.items.size()) == page.limit) {
          found.next_cursor = encode_cursor(query, {at, 0});
          return found;
        }
        found.items.push_back(item);
      }
    }
    if (chunks < chunks_at_once) return found;
    from_ordinal = ordinal;
  }
}

template std::int64_t append(Database&, const End&, const std::vector<Sample>&, bool, std::int64_t);
template std::int64_t append(Database&, const End&, const std::vector<CovariateChange>&, bool, std::int64_t);
template Result<TelemetryPage> read_page(Database&, MissionKey, TimeRange, const PageRequest&);
template Result<CovariatePage> read_page(Database&, MissionKey, TimeRange, const PageRequest&);

void drop_recordings(Database& database, MissionKey key) {
  for (const char* sql :
       {"DELETE FROM trace WHERE mission_key = ?", "DELETE FROM telemetry_chunk WHERE mission_key = ?",
        "DELETE FROM covariate_chunk WHERE mission_key = ?"})
    Rows(database, sql, key).run_later();
}

std::int64_t encoded_bytes(Database& database) {
  return database.integer(
      "SELECT CAST((SELECT coalesce(sum(bytes), 0) FROM telemetry_chunk) + (SELECT coalesce(sum(bytes), 0) "
      "FROM covariate_chunk) AS BIGINT)");
}

std::int64_t count(Database& database) {
  return database.integer(
      "SELECT (SELECT count(*) FROM telemetry_chunk) + (SELECT count(*) FROM covariate_chunk)");
}

std::int64_t prune(Database& database, const Retention& keep, std::int64_t max_chunks,
                   std::int64_t now_utime_us) {
  std::int64_t total_bytes = keep.telemetry_max_bytes ? encoded_bytes(database) : 0;
  std::optional<std::int64_t> past_utime_us;
  if (keep.telemetry_max_age_us) past_utime_us = now_utime_us - *keep.telemetry_max_age_us;
  std::vector<std::pair<bool, std::int64_t>> dropped;  // whether of covariates, and the key
  {
    // Only sealed chunks: a tail stays whole until it is merged.
    Rows rows(database,
              "SELECT 0, chunk_key, stored_utime_us AS stored, bytes FROM telemetry_chunk WHERE sealed = 1 "
              "UNION ALL SELECT 1, chunk_key, stored_utime_us, bytes FROM covariate_chunk WHERE sealed = 1 "
              "ORDER BY stored, chunk_key LIMIT ?",
              max_chunks);
    while (rows.next()) {
      const bool of_covariates = rows.boolean();
      const std::int64_t key = rows.integer();
      const std::int64_t stored = rows.integer();
      const bool too_old = past_utime_us && stored < *past_utime_us;
      const bool too_much = keep.telemetry_max_bytes && total_bytes > *keep.telemetry_max_bytes;
      if (!too_old && !too_much) break;
      total_bytes -= rows.integer();
      dropped.emplace_back(of_covariates, key);
    }
  }
  for (const auto& [of_covariates, key] : dropped)
    Rows(database,
         of_covariates ? "DELETE FROM covariate_chunk WHERE chunk_key = ?"
                       : "DELETE FROM telemetry_chunk WHERE chunk_key = ?",
         key)
        .run_later();
  database.finish_later();
  return static_cast<std::int64_t>(dropped.size());
}

}  // namespace joulecast::history::chunks
