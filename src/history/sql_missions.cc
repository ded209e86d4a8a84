// Queries of missions: filters, orders, pages and sums.
#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>
#include <utility>

#include "history/cursor.h"
#include "history/sql_filter.h"
#include "history/sql_queries.h"
#include "history/sql_rows.h"
#include "signals/account_ratios.h"

namespace joulecast::history::queries {
namespace {

const std::string& state_sql() {
  static const std::string sql = [] {
    std::string text = "(CASE state";
    for (std::size_t k = 0; k < mission_state_count; ++k)
      text += " WHEN '" + std::string(name(static_cast<MissionState>(k))) + "' THEN " + std::to_string(k);
    return text + " END)";
  }();
  return sql;
}

enum class Kind { integer, real, text };

struct Column {
  std::string sql;
  Kind kind = Kind::real;
};

Column column_of(MissionOrder order) {
  switch (order) {
    case MissionOrder::start:
      return {"start_utime_us", Kind::integer};
    case MissionOrder::robot:
      return {"robot_id", Kind::text};
    case MissionOrder::mission:
      return {"mission_id", Kind::text};
    case MissionOrder::state:
      return {state_sql(), Kind::integer};
    case MissionOrder::duration:
      return {"duration_s"};
    case MissionOrder::distance:
      return {"distance_m"};
    case MissionOrder::payload:
      return {"payload_kg"};
    case MissionOrder::energy:
      return {"battery_j"};
    case MissionOrder::modelled:
      return {"modelled_j"};
    case MissionOrder::ratio:
      return {ratio_sql()};
    case MissionOrder::wh_per_km:
      return {wh_per_km_sql()};
    case MissionOrder::charge:
      return {"charge_ah"};
  }
  return {"start_utime_us", Kind::integer};
}

// The place of the last mission of a page: its value as a number, 0 for a text, which never changes and is
// read again by the key; and its key.
CursorPlace place_of(Rows& rows, Kind kind, MissionKey key) {
  if (kind == Kind::integer) return {rows.integer(), key};
  if (kind == Kind::real) return {std::bit_cast<std::int64_t>(rows.real()), key};
  return {0, key};
}

// Missions behind a place in an order, as a condition with its values.
class Behind {
 public:
  Behind(const Column& column, bool ascending, CursorPlace place)
      : place_(place), kind_(column.kind), real_(std::bit_cast<double>(place[0])) {
    const std::string beyond = ascending ? " > " : " < ";
    const std::string& c = column.sql;
    if (kind_ == Kind::integer) {
      sql_ = " AND (" + c + ", mission_key)" + beyond + "(?, ?)";
    } else if (kind_ == Kind::text) {
      sql_ = " AND (" + c + ", mission_key)" + beyond + "((SELECT " + c +
             " FROM mission WHERE mission_key = ?), ?)";
    } else if (std::isnan(real_)) {
      sql_ = " AND " + c + " IS NULL AND mission_key" + beyond + "?";
    } else {
      sql_ = " AND ((" + c + ", mission_key)" + beyond + "(?, ?) OR " + c + " IS NULL)";
    }
  }

  const std::string& sql() const { return sql_; }

  void bind(Rows& rows) const {
    if (kind_ == Kind::integer) rows.bind(place_[0]);
    if (kind_ == Kind::text) rows.bind(place_[1]);
    if (kind_ == Kind::real && !std::isnan(real_)) rows.bind(real_);
    rows.bind(place_[1]);
  }

 private:
  CursorPlace place_;
  Kind kind_;
  double real_;
  std::string sql_;
};

std::string select_missions() {
  return "SELECT " + std::string(mission_identity_columns) + ", " + mission_content_columns();
}

bool has_mission(Database& database, MissionKey key) {
  Rows rows(database.statement("SELECT 1 FROM mission WHERE mission_key = ?"));
  return rows.bind(key).next();
}

const std::string& select_totals() {
  static const std::string sql = [] {
    std::string sums = "sum(";
    for (const char c : accounts_columns()) sums += c == ',' ? std::string("), sum(") : std::string(1, c);
    return "count(*), count(*) FILTER (WHERE measured_s > 0), count(*) FILTER (WHERE incomplete = 1), "
           "CAST(coalesce(sum(samples), 0) AS BIGINT), CAST(coalesce(sum(gap_count), 0) AS BIGINT), "
           "coalesce(sum(gap_s), 0.0), " +
           sums + ") FROM mission";
  }();
  return sql;
}

Totals read_totals(Rows& rows) {
  Totals t;
  t.missions = rows.integer();
  t.measured_missions = rows.integer();
  t.incomplete_missions = rows.integer();
  t.samples = rows.integer();
  t.gap_count = rows.integer();
  t.gap_s = rows.real();
  t.accounts = read_accounts(rows);
  return t;
}

}  // namespace

Result<Mission> mission(Database& database, MissionKey key) {
  static const std::string sql = select_missions() + " FROM mission WHERE mission_key = ?";
  Rows rows(database.statement(sql));
  if (!rows.bind(key).next()) return no_mission(key);
  return read_mission(rows);
}

Result<MissionPage> missions(Database& database, const MissionFilter& filter, const PageRequest& page,
                             MissionSort sort) {
  if (auto ok = check_filter(filter); !ok) return tl::unexpected(ok.error());
  if (auto ok = check_limit("limit", page.limit, max_page_size); !ok) return tl::unexpected(ok.error());
  const Where where(filter);
  const Column column = column_of(sort.by);
  const std::string direction = sort.ascending ? " ASC" : " DESC";
  const std::string query = "missions by " + column.sql + direction + where.identity();
  std::optional<Behind> behind;
  if (!page.cursor.empty()) {
    const auto place = decode_cursor(query, page.cursor);
    if (!place) return tl::unexpected(place.error());
    if (column.kind == Kind::text && !has_mission(database, (*place)[1]))
      return invalid("cursor", "the mission at which the page before ended is gone: begin again");
    behind.emplace(column, sort.ascending, *place);
  }
  const std::string sql = select_missions() + ", " + column.sql + " FROM mission" + where.sql() +
                          (behind ? behind->sql() : "") + " ORDER BY " +
                          (column.kind == Kind::real ? column.sql + " IS NULL, " : "") + column.sql +
                          direction + ", mission_key" + direction + " LIMIT ?";
  const auto statement = database.prepare(sql);
  Rows rows(*statement);
  where.bind(rows);
  if (behind) behind->bind(rows);
  // One more than asked for tells whether a page follows.
  rows.bind(page.limit + 1);
  MissionPage result;
  CursorPlace last{};
  while (rows.next()) {
    if (static_cast<std::int64_t>(result.missions.size()) == page.limit) {
      result.next_cursor = encode_cursor(query, last);
      break;
    }
    Result<Mission> read = read_mission(rows);
    if (!read) return tl::unexpected(std::move(read.error()));
    last = place_of(rows, column.kind, read->key);
    result.missions.push_back(std::move(*read));
  }
  return result;
}

Result<Totals> totals(Database& database, const MissionFilter& filter) {
  if (auto ok = check_filter(filter); !ok) return tl::unexpected(ok.error());
  const Where where(filter);
  const std::string sql = "SELECT " + select_totals() + where.sql() + std::string(not_annulled);
  const auto statement = database.prepare(sql);
  Rows rows(*statement);
  where.bind(rows);
  rows.next();
  return read_totals(rows);
}

Result<std::vector<TotalsGroup>> grouped_totals(Database& database, const MissionFilter& filter, Grouping by,
                                                std::int64_t utc_offset_s) {
  if (auto ok = check_filter(filter); !ok) return tl::unexpected(ok.error());
  constexpr std::int64_t day_us = 86'400'000'000;
  const Where where(filter);
  const std::string period = std::to_string(by == Grouping::week ? 7 * day_us : day_us);
  const std::string group = by == Grouping::robot ? "robot_id"
                                                  : "start_utime_us - ((start_utime_us + ?) % " + period +
                                                        " + " + period + ") % " + period;
  const std::string sql = "SELECT " + group + ", " + select_totals() + where.sql() +
                          std::string(not_annulled) + " GROUP BY 1 ORDER BY 1 LIMIT " +
                          std::to_string(max_groups + 1);
  const auto statement = database.prepare(sql);
  Rows rows(*statement);
  // 1970 began on a Thursday, three days after a Monday.
  if (by != Grouping::robot)
    rows.bind(utc_offset_s * 1'000'000 + (by == Grouping::week ? 3 * day_us : std::int64_t{0}));
  where.bind(rows);
  std::vector<TotalsGroup> groups;
  while (rows.next()) {
    if (groups.size() == max_groups)
      return invalid("group_by", "gives more than " + std::to_string(max_groups) +
                                     " groups: choose a shorter time or fewer robots");
    TotalsGroup& next = groups.emplace_back();
    by == Grouping::robot ? void(next.robot_id = rows.text()) : void(next.from_utime_us = rows.integer());
    next.totals = read_totals(rows);
  }
  return groups;
}

Result<std::vector<Mission>> open_missions(Database& database) {
  static const std::string sql =
      select_missions() + " FROM mission WHERE state = 'open' ORDER BY start_utime_us, mission_key";
  Rows rows(database.statement(sql));
  return read_all<Mission>(rows, read_mission);
}

}  // namespace joulecast::history::queries
