// Queries of missions: filters, orders, pages and sums.
#include <bit>
#include <cmath>
#include <utility>

#include "base/try.h"
#include "history/mission_days.h"
#include "history/sql_filter.h"
#include "history/sql_queries.h"
#include "history/sql_rows.h"
#include "signals/ledger.h"

namespace joulecast::history {
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

const Column& column_of(MissionOrder order) {
  static const Column columns[] = {{"start_utime_us", Kind::integer},
                                   {"robot_id", Kind::text},
                                   {"mission_id", Kind::text},
                                   {state_sql(), Kind::integer},
                                   {"duration_s"},
                                   {"distance_m"},
                                   {"payload_kg"},
                                   {"battery_j"},
                                   {"modelled_j"},
                                   {ratio_sql()},
                                   {wh_per_km_sql()},
                                   {"charge_ah"}};
  return columns[static_cast<std::size_t>(order)];
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

Totals read_totals(Rows& rows) {
  Totals t;
  read_values(rows, t.missions, t.measured_missions, t.incomplete_missions, t.samples, t.gap_count, t.gap_s);
  t.accounts = *read_record<signals::Accounts>(rows);
  return t;
}

// Missions to be summed: "FROM ... WHERE ...", with its parameters.
class Summed {
 public:
  // `whole_days`: missions of one day are not distinguished.
  Summed(const Database& database, const MissionFilter& filter, bool whole_days)
      : filter_(filter), where_(filter) {
    rolled_up_ = database.is_postgres() && whole_days && names_robots_and_times(filter);
    if (rolled_up_)
      add_parts();
    else
      sql_ = " FROM mission" + where_.sql() + " AND " + std::string(not_annulled);
  }

  std::string sums() const { return rolled_up_ ? totals_of_parts() : totals_of_missions(); }
  const std::string& sql() const { return sql_; }

  void bind(Rows& rows) const {
    if (!rolled_up_) where_.bind(rows);
    for (int k = 0; k < parts_; ++k)
      for (const std::string& robot_id : filter_.robot_ids) rows.bind(robot_id);
  }

 private:
  static bool names_robots_and_times(const MissionFilter& f) {
    return !f.mission_id && !f.name_contains && f.states.empty() && !f.incomplete && !f.payload_min_kg &&
           !f.payload_max_kg && !f.ratio_min && !f.ratio_max;
  }

  // Ended missions of whole days are already summed by day. The others are: missions of the first and of the
  // last day if the time range begins or ends within them, and open missions.
  void add_parts() {
    const std::int64_t day_before_end = whole_future - day_us, day_after_begin = whole_past + day_us;
    const auto [from, to] = filter_.started;
    const std::int64_t first = from <= day_after_begin  ? whole_past
                               : from >= day_before_end ? whole_future
                                                        : day_of(from + day_us - 1);
    const std::int64_t last = to >= day_before_end    ? whole_future
                              : to <= day_after_begin ? whole_past
                                                      : day_of(to);
    sql_ = " FROM (SELECT robot_id, day_utime_us AS start_utime_us, " + totals_columns() +
           " FROM mission_day WHERE missions > 0" + within("day_utime_us", first, last);
    add_missions(" AND state = 'open'", from, to);
    if (first >= last) {
      add_missions(" AND state <> 'open'", from, to);
    } else {
      if (from < first) add_missions(" AND state <> 'open'", from, first);
      if (last < to) add_missions(" AND state <> 'open'", last, to);
    }
    sql_ += ") AS parts WHERE TRUE";
  }

  void add_missions(const std::string& condition, std::int64_t from, std::int64_t to) {
    sql_ += " UNION ALL SELECT robot_id, start_utime_us, " + totals_of_one() + " FROM mission WHERE " +
            std::string(not_annulled) + condition + within("start_utime_us", from, to);
  }

  std::string within(const std::string& time, std::int64_t from, std::int64_t to) {
    ++parts_;
    std::string sql;
    if (from != whole_past) sql += " AND " + time + " >= " + std::to_string(from);
    if (to != whole_future) sql += " AND " + time + " < " + std::to_string(to);
    if (!filter_.robot_ids.empty()) sql += " AND " + among("robot_id", filter_.robot_ids.size());
    return sql;
  }

  const MissionFilter& filter_;
  const Where where_;
  bool rolled_up_ = false;
  int parts_ = 0;
  std::string sql_;
};

}  // namespace

Result<Mission> Store::mission(MissionKey key) const {
  return read([&](Database& database) -> Result<Mission> {
    TRY_ASSIGN(auto found, select_one<Mission>(database, "FROM mission WHERE mission_key = ?", key));
    if (!found) return no_mission(key);
    return std::move(*found);
  });
}

Result<MissionPage> Store::missions(const MissionFilter& filter, const PageRequest& page,
                                    MissionSort sort) const {
  return read([&](Database& database) -> Result<MissionPage> {
    TRY(check_filter(filter));
    TRY(check_limit("limit", page.limit, max_page_size));
    const Where where(filter);
    const Column& column = column_of(sort.by);
    const std::string direction = sort.ascending ? " ASC" : " DESC";
    const std::string query = "missions by " + column.sql + direction + where.identity();
    std::optional<Behind> behind;
    if (!page.cursor.empty()) {
      TRY_ASSIGN(const auto place, decode_cursor(query, page.cursor));
      if (column.kind == Kind::text && !has_mission(database, (place)[1]))
        return invalid("cursor", "the mission at which the page before ended is gone: begin again");
      behind.emplace(column, sort.ascending, place);
    }
    const std::string sql = "SELECT " + columns_of<Mission>() + ", " + column.sql + " FROM mission" +
                            where.sql() + (behind ? behind->sql() : "") + " ORDER BY " +
                            (column.kind == Kind::real ? column.sql + " IS NULL, " : "") + column.sql +
                            direction + ", mission_key" + direction + " LIMIT ?";
    const auto statement = database.prepare(sql);
    Rows rows(*statement);
    where.bind(rows);
    if (behind) behind->bind(rows);
    // One more than the limit, to detect a following page.
    rows.bind(page.limit + 1);
    MissionPage result;
    CursorPlace last{};
    while (rows.next()) {
      if (static_cast<std::int64_t>(result.missions.size()) == page.limit) {
        result.next_cursor = encode_cursor(query, last);
        break;
      }
      TRY_ASSIGN(Mission read, read_record<Mission>(rows));
      last = place_of(rows, column.kind, read.key);
      result.missions.push_back(std::move(read));
    }
    return result;
  });
}

Result<Totals> Store::totals(const MissionFilter& filter) const {
  return read([&](Database& database) -> Result<Totals> {
    TRY(check_filter(filter));
    const Summed summed(database, filter, true);
    const auto statement = database.prepare("SELECT " + summed.sums() + summed.sql());
    Rows rows(*statement);
    summed.bind(rows);
    rows.next();
    return read_totals(rows);
  });
}

Result<std::vector<TotalsGroup>> Store::grouped_totals(const MissionFilter& filter, Grouping by,
                                                       std::int64_t utc_offset_s) const {
  return read([&](Database& database) -> Result<std::vector<TotalsGroup>> {
    TRY(check_filter(filter));
    const bool timed = by != Grouping::robot, of_robots = by != Grouping::day && by != Grouping::week;
    const bool weeks = by == Grouping::week || by == Grouping::robot_week;
    // A day of another clock has parts of two.
    const Summed summed(database, filter, !timed || utc_offset_s * 1'000'000 % day_us == 0);
    const std::string period = std::to_string(weeks ? 7 * day_us : day_us);
    const std::string keys = timed && of_robots ? "1, 2" : "1";
    std::string sql = of_robots ? "SELECT robot_id, " : "SELECT ";
    if (timed)
      sql += "start_utime_us - ((start_utime_us + ?) % " + period + " + " + period + ") % " + period + ", ";
    sql += summed.sums() + summed.sql() + " GROUP BY " + keys + " ORDER BY " + keys + " LIMIT " +
           std::to_string(max_groups + 1);
    const auto statement = database.prepare(sql);
    Rows rows(*statement);
    // 1970 began on a Thursday, three days after a Monday.
    if (timed) rows.bind(utc_offset_s * 1'000'000 + (weeks ? 3 * day_us : std::int64_t{0}));
    summed.bind(rows);
    std::vector<TotalsGroup> groups;
    while (rows.next()) {
      if (groups.size() == max_groups)
        return invalid("group_by", "gives more than " + std::to_string(max_groups) +
                                       " groups: choose a shorter time or fewer robots");
      TotalsGroup& next = groups.emplace_back();
      if (of_robots) next.robot_id = rows.text();
      if (timed) next.from_utime_us = rows.integer();
      next.totals = read_totals(rows);
    }
    return groups;
  });
}

Result<std::vector<Mission>> Store::recover() const {
  return read([&](Database& database) {
    return select_all<Mission>(database,
                               "FROM mission WHERE state = 'open' ORDER BY start_utime_us, mission_key");
  });
}

}  // namespace joulecast::history
