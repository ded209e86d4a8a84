#include "history/sql_queries.h"

#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/try.h"
#include "history/keyed_sql.h"
#include "history/sql_chunks.h"
#include "history/sql_rows.h"
#include "history/trace_merge.h"

namespace joulecast::history::queries {
namespace {

tl::unexpected<Error> no_robot(std::string_view robot_id) {
  return fail(Fault::not_found, "robot_id", "no robot is called '" + std::string(robot_id) + "'");
}

bool has_robot(Database& database, std::string_view robot_id) {
  Rows rows(database.statement("SELECT 1 FROM robot WHERE robot_id = ?"));
  return rows.bind(robot_id).next();
}

constexpr std::string_view select_model =
    "SELECT model.robot_id, version, model.created_utime_us, origin, note, parent_version, "
    "coalesce(version = active_version, FALSE), model_json, coalesce(evidence_json, '') FROM model JOIN "
    "robot USING "
    "(robot_id) WHERE model.robot_id = ?";

Result<ModelVersion> read_model(Rows& rows) {
  ModelVersion m;
  m.robot_id = rows.text();
  m.version = rows.integer();
  m.created_utime_us = rows.integer();
  const std::string origin_name = rows.text();
  const auto origin = model_origin_from(origin_name);
  if (!origin) return fail(Fault::corrupt, "model.origin", "unknown origin '" + origin_name + "'");
  m.origin = *origin;
  m.note = rows.text();
  m.parent_version = rows.optional_integer();
  m.active = rows.boolean();
  m.model_json = rows.text();
  m.evidence_json = rows.text();
  return m;
}

Result<void> check_range(TimeRange range) {
  if (range.from_utime_us <= range.to_utime_us) return {};
  return invalid("from_utime_us", "must not be later than to_utime_us");
}

}  // namespace

bool has_mission(Database& database, MissionKey key) {
  Rows rows(database.statement("SELECT 1 FROM mission WHERE mission_key = ?"));
  return rows.bind(key).next();
}

tl::unexpected<Error> no_mission(MissionKey key) {
  return fail(Fault::not_found, "id", "no mission has key " + std::to_string(key));
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

Result<std::vector<RobotRecord>> robots(Database& database) {
  Rows rows(
      database.statement("SELECT robot_id, created_utime_us, active_version FROM robot ORDER BY robot_id"));
  return read_all<RobotRecord>(rows, [](Rows& row) -> Result<RobotRecord> {
    RobotRecord record;
    record.robot_id = row.text();
    record.created_utime_us = row.integer();
    record.active_version = row.optional_integer();
    return record;
  });
}

Result<ModelVersion> model(Database& database, std::string_view robot_id,
                           std::optional<std::int64_t> version) {
  static const std::string active = std::string(select_model) + " AND version = active_version";
  static const std::string given = std::string(select_model) + " AND version = ?";
  Rows rows(database.statement(version ? given : active));
  rows.bind(robot_id);
  if (version) rows.bind(*version);
  if (rows.next()) return read_model(rows);
  if (!has_robot(database, robot_id)) return no_robot(robot_id);
  return fail(Fault::not_found, "model_version",
              "robot '" + std::string(robot_id) + "' has no " +
                  (version ? "model version " + std::to_string(*version) : std::string("active model")));
}

Result<std::vector<ModelVersion>> model_versions(Database& database, std::string_view robot_id) {
  if (!has_robot(database, robot_id)) return no_robot(robot_id);
  static const std::string sql = std::string(select_model) + " ORDER BY version DESC";
  Rows rows(database.statement(sql));
  rows.bind(robot_id);
  return read_all<ModelVersion>(rows, read_model);
}

std::optional<MissionKey> key_of(Database& database, std::string_view robot_id, std::string_view mission_id,
                                 std::int64_t start_utime_us) {
  Rows rows(database.statement(
      "SELECT mission_key FROM mission WHERE robot_id = ? AND mission_id = ? AND start_utime_us = ?"));
  rows.bind(robot_id).bind(mission_id).bind(start_utime_us);
  return rows.next() ? std::optional(rows.integer()) : std::nullopt;
}

std::optional<MissionStart> last_called(Database& database, std::string_view robot_id,
                                        std::string_view mission_id, std::int64_t before_utime_us) {
  Rows rows(database.statement(
      "SELECT start_utime_us, mission_key FROM mission WHERE robot_id = ? AND mission_id = "
      "? AND start_utime_us < ? ORDER BY start_utime_us DESC LIMIT 1"));
  rows.bind(robot_id).bind(mission_id).bind(before_utime_us);
  if (!rows.next()) return std::nullopt;
  const std::int64_t start_utime_us = rows.integer();
  return MissionStart{start_utime_us, rows.integer()};
}

MissionKey greatest_key(Database& database) {
  return database.integer("SELECT coalesce(max(mission_key), 0) FROM mission");
}

Result<Trace> trace(Database& database, MissionKey key, TimeRange range, std::int64_t max_points) {
  TRY(check_range(range));
  TRY(check_limit("points", max_points, max_trace_points));
  if (!has_mission(database, key)) return no_mission(key);
  std::optional<std::int64_t> first;
  std::optional<std::int64_t> last;
  {
    // Two lookups by primary key, where one query for both ends would scan.
    static const KeyedSql ends(
        "SELECT (SELECT min(start_utime_us) FROM trace WHERE $of_mission AND start_utime_us >= ?2 AND "
        "start_utime_us < ?3), (SELECT max(start_utime_us) FROM trace WHERE $of_mission AND "
        "start_utime_us >= ?2 AND start_utime_us < ?3)");
    Rows rows(ends.in(database));
    rows.bind(key).bind(range.from_utime_us).bind(range.to_utime_us).next();
    first = rows.optional_integer();
    last = rows.optional_integer();
  }
  if (!first || !last) return Trace{};
  TraceMerger merger(*first, merged_width_us(*first, *last + 1, max_points));
  static const KeyedSql sql("SELECT start_utime_us, " + std::string(trace_columns) +
                            " FROM trace WHERE $of_mission AND start_utime_us >= ?2 AND "
                            "start_utime_us <= ?3 ORDER BY start_utime_us");
  Rows rows(sql.in(database));
  // Where the trace is in partitions by time, the others are not looked into.
  rows.bind(key).bind(*first).bind(*last);
  while (rows.next()) merger.add(read_bucket(rows));
  return merger.finish();
}

Result<TelemetryPage> telemetry(Database& database, MissionKey key, TimeRange range,
                                const PageRequest& page) {
  TRY(check_page(database, key, range, page));
  return chunks::telemetry(database, key, range, page);
}

Result<CovariatePage> covariates(Database& database, MissionKey key, TimeRange range,
                                 const PageRequest& page) {
  TRY(check_page(database, key, range, page));
  return chunks::covariates(database, key, range, page);
}

Result<std::vector<Event>> events(Database& database, std::int64_t after_id, std::int64_t limit,
                                  const std::optional<std::string>& robot_id) {
  TRY(check_limit("limit", limit, max_page_size));
  Rows rows(database.statement(
      robot_id ? "SELECT event_id, utime_us, coalesce(robot_id, ''), kind, detail_json FROM event WHERE "
                 "event_id > ? AND robot_id = ? ORDER BY event_id LIMIT ?"
               : "SELECT event_id, utime_us, coalesce(robot_id, ''), kind, detail_json FROM event WHERE "
                 "event_id > ? ORDER BY event_id LIMIT ?"));
  rows.bind(after_id);
  if (robot_id) rows.bind(*robot_id);
  rows.bind(limit);
  return read_all<Event>(rows, [](Rows& row) -> Result<Event> {
    Event event;
    event.id = row.integer();
    event.utime_us = row.integer();
    event.robot_id = row.text();
    event.kind = row.text();
    event.detail_json = row.text();
    return event;
  });
}

Result<std::optional<ResumeState>> resume_state(Database& database, std::string_view robot_id) {
  static const std::string sql =
      "SELECT robot_id, " + std::string(resume_state_columns) + " FROM energy_state WHERE robot_id = ?";
  Rows rows(database.statement(sql));
  rows.bind(robot_id);
  if (!rows.next()) return std::nullopt;
  return read_resume_state(rows);
}

Result<std::optional<RequestAnswer>> answer(Database& database, std::string_view actor,
                                            std::string_view key) {
  Rows rows(database.statement(
      "SELECT fingerprint, utime_us, status, location, body FROM request_answer WHERE actor = ? AND "
      "idempotency_key = ?"));
  rows.bind(actor).bind(key);
  if (!rows.next()) return std::nullopt;
  RequestAnswer found{std::string(actor), std::string(key), {}, 0, 0, {}, {}};
  found.fingerprint = rows.text();
  found.utime_us = rows.integer();
  found.status = rows.integer();
  found.location = rows.text();
  found.body = rows.text();
  return found;
}

tl::unexpected<Error> no_floor_plan(std::string_view map, std::string_view level) {
  return fail(Fault::not_found, "level",
              std::string("map ").append(map).append(" has no plan of level ").append(level));
}

// Without the image.
FloorPlan read_floor_plan(Rows& row) {
  FloorPlan plan{row.text(), {}, 0, 0, 0, 0, 0, {}, {}, {}};
  plan.level = row.text();
  plan.utime_us = row.integer();
  plan.resolution_m = row.real();
  plan.origin_x_m = row.real();
  plan.origin_y_m = row.real();
  plan.origin_yaw_rad = row.real();
  plan.chargers = nlohmann::json::parse(row.text()).get<std::vector<std::array<double, 2>>>();
  plan.media_type = row.text();
  return plan;
}

Result<std::vector<FloorPlan>> floor_plans(Database& database) {
  static const std::string columns(floor_plan_columns);
  static const std::string sql =
      "SELECT map, level, " + columns.substr(0, columns.rfind(',')) + " FROM floor_plan ORDER BY map, level";
  Rows rows(database.statement(sql));
  return read_all<FloorPlan>(rows, [](Rows& row) -> Result<FloorPlan> { return read_floor_plan(row); });
}

Result<FloorPlan> floor_plan(Database& database, std::string_view map, std::string_view level) {
  static const std::string sql = std::string("SELECT map, level, ") + floor_plan_columns +
                                 " FROM floor_plan WHERE map = ? AND level = ?";
  Rows rows(database.statement(sql));
  if (!rows.bind(map).bind(level).next()) return no_floor_plan(map, level);
  FloorPlan plan = read_floor_plan(rows);
  const auto image = rows.blob();
  plan.image.assign(reinterpret_cast<const char*>(image.data()), image.size());
  return plan;
}

Result<std::optional<Learned>> learned(Database& database, std::string_view robot_id,
                                       std::string_view topic) {
  Rows rows(database.statement("SELECT utime_us, body_json FROM learned WHERE robot_id = ? AND topic = ?"));
  rows.bind(robot_id).bind(topic);
  if (!rows.next()) return std::nullopt;
  Learned found{std::string(robot_id), std::string(topic), rows.integer(), {}};
  found.body_json = rows.text();
  return found;
}

Result<std::vector<Learned>> all_learned(Database& database, std::string_view topic) {
  Rows rows(database.statement(
      "SELECT robot_id, utime_us, body_json FROM learned WHERE topic = ? ORDER BY robot_id"));
  rows.bind(topic);
  std::vector<Learned> found;
  while (rows.next()) {
    Learned next{rows.text(), std::string(topic), rows.integer(), {}};
    next.body_json = rows.text();
    found.push_back(std::move(next));
  }
  return found;
}

}  // namespace joulecast::history::queries
