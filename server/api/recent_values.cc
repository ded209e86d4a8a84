#include "ingest/recent_values.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "base/json_writer.h"
#include "base/try.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// The last 90 s of live values, with which a page fills its charts when it opens.
namespace joulecast::api {
namespace {

using http::Method;
using http::Request;
using http::Response;

constexpr std::int64_t max_recent_robots = 200;  // a page

void write_values(JsonWriter& json, const std::string& robot_id,
                  const std::vector<ingest::RecentValue>& values) {
  json.begin_object().field("robot_id", robot_id);
  const auto column = [&](std::string_view name, auto value_of) {
    json.key(name).begin_array();
    for (const ingest::RecentValue& each : values) json.value(value_of(each));
    json.end_array();
  };
  using Value = const ingest::RecentValue&;
  column("utime_us", [](Value v) { return v.utime_us; });
  column("measured_power_w", [](Value v) { return v.measured_power_w; });
  column("modelled_power_w", [](Value v) { return v.modelled_power_w; });
  column("speed_m_s", [](Value v) { return v.speed_m_s; });
  column("x_m", [](Value v) { return v.pose[0]; });
  column("y_m", [](Value v) { return v.pose[1]; });
  column("heading_rad", [](Value v) { return v.pose[2]; });
  json.end_object();
}

Result<Response> recent(const Services& services, const Request& request) {
  TRY_ASSIGN(const auto chosen, robot_ids_of(request));
  std::set<std::string> ids(chosen.begin(), chosen.end());
  if (ids.empty())
    for (const auto& snapshot : services.fleet.all()) ids.insert(snapshot->robot_id);
  const std::int64_t limit = request.query_integer("limit").value_or(max_recent_robots);
  auto next = ids.upper_bound(std::string(request.query_value("cursor").value_or("")));
  std::string last;
  JsonWriter json;
  json.begin_object().field("window_s", static_cast<double>(ingest::recent_window_us) / 1e6);
  json.key("robots").begin_array();
  for (std::int64_t k = 0; k < limit && next != ids.end(); ++k, ++next)
    write_values(json, last = *next, services.recent.of(*next));
  json.end_array();
  write_cursor(json, next == ids.end() ? "" : last);
  json.end_object();
  return http::json_response(json.take());
}

}  // namespace

std::vector<TableRow> recent_value_rows() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = Method::get,
        .path = "/v1/recent-values",
        .operation_id = "listRecentValues",
        .role = http::Role::read,
        .summary = "The last 90 s of robots' live values in columns, one a second, for charts that begin "
                   "filled; kept in memory since the daemon's start",
        .parameters = {{.name = "robot_id",
                        .type = http::Parameter::Type::text,
                        .description = "only this robot, or these, separated by commas; a robot that was "
                                       "not heard has empty columns"},
                       limit_parameter("robots a page", max_recent_robots),
                       cursor_parameter()},
        .response_schema = "recent-values",
        .rounded = true},
       answered_by(recent)});
  return rows;
}

}  // namespace joulecast::api
