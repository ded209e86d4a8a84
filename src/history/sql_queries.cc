#include "history/sql_queries.h"

#include <utility>

#include "base/try.h"
#include "history/sql_chunks.h"
#include "history/sql_filter.h"
#include "history/sql_rows.h"
#include "history/trace_merge.h"

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

}  // namespace joulecast::history
