#include "history/sql_queries.h"

#include <bit>
#include <cmath>
#include <utility>

#include "base/try.h"
#include "history/mission_days.h"
#include "history/sql_chunks.h"
#include "history/sql_filter.h"
#include "history/sql_rows.h"
#include "history/trace_merge.h"
#include "signals/ledger.h"

namespace joulecast::history {
namespace {

tl::unexpected<Error> no_robot(std::string_view robot_id) {
  return fail(Fault::not_found, "robot_id", "no robot is called '" + std::string(robot_id) + "'");
}

bool has_robot(Database& database, std::string_view robot_id) {
  Rows rows(database, "SELECT 1 FROM robot WHERE robot_id = ?", robot_id);
  return rows.next();
}

// The model's columns, and whether it is the active one.
std::string select_model() {
  return "SELECT " + columns_of<ModelVersion>() +
         ", version = (SELECT active_version FROM robot WHERE robot.robot_id = model.robot_id) AS is_active "
         "FROM model WHERE robot_id = ?";
}

Result<ModelVersion> read_model(Rows& rows) {
  Result<ModelVersion> model = read_record<ModelVersion>(rows);
  if (model) model->active = rows.boolean();
  return model;
}

std::string state_sql() {
  std::string text = "(CASE state";
  for (std::size_t k = 0; k < mission_state_count; ++k)
    text += " WHEN '" + std::string(name(static_cast<MissionState>(k))) + "' THEN " + std::to_string(k);
  return text + " END)";
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

bool has_mission(Database& database, MissionKey key) {
  Rows rows(database, "SELECT 1 FROM mission WHERE mission_key = ?", key);
  return rows.next();
}

tl::unexpected<Error> no_mission(MissionKey key) {
  return fail(Fault::not_found, "id", "no mission has number " + std::to_string(key));
}

Result<void> check_limit(std::string_view field, std::int64_t limit, std::int64_t greatest) {
  if (limit >= 1 && limit <= greatest) return {};
  return invalid(std::string(field), std::to_string(limit) + " is outside 1 to " + std::to_string(greatest));
}

// Checks the arguments of both kinds of raw pages.
static Result<void> check_page(Database& database, MissionKey key, TimeRange range, const PageRequest& page) {
  TRY(check_range(range));
  TRY(check_limit("limit", page.limit, max_telemetry_samples));
  if (!has_mission(database, key)) return no_mission(key);
  return {};
}

Result<std::vector<RobotRecord>> Store::robots() const {
  return read(
      [](Database& database) { return select_all<RobotRecord>(database, "FROM robot ORDER BY robot_id"); });
}

Result<ModelVersion> Store::model(std::string_view robot_id, std::optional<std::int64_t> version) const {
  return read([&](Database& database) -> Result<ModelVersion> {
    static const std::string active =
        select_model() +
        " AND version = (SELECT active_version FROM robot WHERE robot.robot_id = model.robot_id)";
    static const std::string given = select_model() + " AND version = ?";
    Rows rows(database, version ? given : active, robot_id);
    if (version) rows.bind(*version);
    if (rows.next()) return read_model(rows);
    if (!has_robot(database, robot_id)) return no_robot(robot_id);
    return fail(Fault::not_found, "model_version",
                "robot '" + std::string(robot_id) + "' has no " +
                    (version ? "model version " + std::to_string(*version) : std::string("active model")));
  });
}

Result<std::vector<ModelVersion>> Store::model_versions(std::string_view robot_id) const {
  return read([&](Database& database) -> Result<std::vector<ModelVersion>> {
    if (!has_robot(database, robot_id)) return no_robot(robot_id);
    static const std::string sql = select_model() + " ORDER BY version DESC";
    Rows rows(database, sql, robot_id);
    return read_all<ModelVersion>(rows, read_model);
  });
}

MissionKey last_called(Database& database, std::string_view robot_id, std::string_view mission_id,
                       std::int64_t before_utime_us) {
  Rows rows(
      database,
      "SELECT mission_key FROM mission WHERE robot_id = ? AND mission_id = ? AND start_utime_us < ? ORDER BY "
      "start_utime_us DESC LIMIT 1",
      robot_id, mission_id, before_utime_us);
  return rows.next() ? rows.integer() : 0;
}

MissionKey greatest_key(Database& database) {
  return database.integer("SELECT coalesce(max(mission_key), 0) FROM mission");
}

Result<Trace> Store::trace(MissionKey key, TimeRange range, std::int64_t max_points) const {
  return read([&](Database& database) -> Result<Trace> {
    TRY(check_range(range));
    TRY(check_limit("points", max_points, max_trace_points));
    if (!has_mission(database, key)) return no_mission(key);
    std::optional<std::int64_t> first;
    std::optional<std::int64_t> last;
    {
      // Two lookups by primary key, where one query for both ends would scan.
      Rows rows(
          database,
          "SELECT (SELECT min(start_utime_us) FROM trace WHERE mission_key = ?1 AND start_utime_us >= ?2 "
          "AND start_utime_us < ?3), (SELECT max(start_utime_us) FROM trace WHERE mission_key = ?1 AND "
          "start_utime_us >= ?2 AND start_utime_us < ?3)",
          key, range.from_utime_us, range.to_utime_us);
      rows.next();
      read_values(rows, first, last);
    }
    if (!first || !last) return Trace{};
    TraceMerger merger(*first, merged_width_us(*first, *last + 1, max_points));
    static const std::string sql = "SELECT " + columns_of<TraceBucket>() +
                                   " FROM trace WHERE mission_key = ? AND start_utime_us >= ? AND "
                                   "start_utime_us <= ? ORDER BY start_utime_us";
    Rows rows(database, sql, key, *first, *last);
    while (rows.next()) merger.add(*read_record<TraceBucket>(rows));
    return merger.finish();
  });
}

Result<TelemetryPage> Store::telemetry(MissionKey key, TimeRange range, const PageRequest& page) const {
  return read([&](Database& database) -> Result<TelemetryPage> {
    TRY(check_page(database, key, range, page));
    return chunks::read_page<signals::Sample>(database, key, range, page);
  });
}

Result<CovariatePage> Store::covariates(MissionKey key, TimeRange range, const PageRequest& page) const {
  return read([&](Database& database) -> Result<CovariatePage> {
    TRY(check_page(database, key, range, page));
    return chunks::read_page<signals::CovariateChange>(database, key, range, page);
  });
}

// Of the table's `<table>_id`, utime_us and `kind`.
template <class Record>
static Result<std::vector<Record>> read_log(Database& database, const std::string& table,
                                            const std::string& kind, std::int64_t behind_id,
                                            std::int64_t limit, const LogFilter& filter) {
  TRY(check_limit("limit", limit, max_page_size));
  TRY(check_range(filter.range));
  if (filter.robot_ids.size() + filter.kinds.size() > max_filter_robots)
    return invalid("kind", "must name, with robot_id, at most " + std::to_string(max_filter_robots));
  std::string sql =
      "SELECT " + columns_of<Record>() + " FROM " + table + " WHERE utime_us >= ? AND utime_us < ?";
  const std::pair<std::string, const std::vector<std::string>&> lists[] = {{"robot_id", filter.robot_ids},
                                                                           {kind, filter.kinds}};
  for (const auto& [column, values] : lists)
    if (!values.empty()) sql += " AND " + among(column, values.size());
  sql += " AND " + table +
         (filter.newest_first ? "_id < ? ORDER BY 1 DESC LIMIT ?" : "_id > ? ORDER BY 1 LIMIT ?");
  const auto statement = database.prepare(sql);
  Rows rows(*statement);
  rows.bind(filter.range.from_utime_us).bind(filter.range.to_utime_us);
  for (const auto& [column, values] : lists)
    for (const std::string& value : values) rows.bind(value);
  return read_all<Record>(rows.bind(behind_id).bind(limit));
}

Result<std::vector<Event>> Store::events(std::int64_t behind_id, std::int64_t limit,
                                         const LogFilter& filter) const {
  return read([&](Database& database) {
    return read_log<Event>(database, "event", "kind", behind_id, limit, filter);
  });
}

Result<std::vector<AuditEntry>> Store::audit(std::int64_t behind_id, std::int64_t limit,
                                             const LogFilter& filter) const {
  return read([&](Database& database) {
    return read_log<AuditEntry>(database, "audit", "action", behind_id, limit, filter);
  });
}

Result<std::optional<ResumeState>> Store::resume_state(std::string_view robot_id) const {
  return read([&](Database& database) {
    return select_one<ResumeState>(database, "FROM energy_state WHERE robot_id = ?", robot_id);
  });
}

Result<std::optional<RequestAnswer>> Store::answer(std::string_view actor, std::string_view key) const {
  return read([&](Database& database) {
    return select_one<RequestAnswer>(database, "FROM request_answer WHERE actor = ? AND idempotency_key = ?",
                                     actor, key);
  });
}

tl::unexpected<Error> no_floor_plan(std::string_view map, std::string_view level) {
  return fail(Fault::not_found, "level",
              std::string("map ").append(map).append(" has no plan of level ").append(level));
}

Result<std::vector<FloorPlan>> Store::floor_plans() const {
  return read([&](Database& database) -> Result<std::vector<FloorPlan>> {
    static const std::string sql =
        "SELECT " + columns_of<FloorPlan>(0, {"image"}) + " FROM floor_plan ORDER BY map, level";
    Rows rows(database, sql);
    return read_all<FloorPlan>(rows);
  });
}

Result<FloorPlan> Store::floor_plan(std::string_view map, std::string_view level) const {
  return read([&](Database& database) -> Result<FloorPlan> {
    TRY_ASSIGN(auto found,
               select_one<FloorPlan>(database, "FROM floor_plan WHERE map = ? AND level = ?", map, level));
    if (!found) return no_floor_plan(map, level);
    return std::move(*found);
  });
}

Result<std::optional<Learned>> learned(Database& database, std::string_view robot_id,
                                       std::string_view topic) {
  return select_one<Learned>(database, "FROM learned WHERE robot_id = ? AND topic = ?", robot_id, topic);
}

Result<std::optional<Learned>> Store::learned(std::string_view robot_id, std::string_view topic) const {
  return read([&](Database& database) { return history::learned(database, robot_id, topic); });
}

Result<std::vector<Learned>> Store::all_learned(std::string_view topic) const {
  return read([&](Database& database) {
    return select_all<Learned>(database, "FROM learned WHERE topic = ? ORDER BY robot_id", topic);
  });
}

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
