#include <ranges>
#include <set>
#include <string>
#include <vector>

#include "base/try.h"
#include "ingest/fleet_view.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// The last 90 s of live values, with which a page fills its charts when it opens.
namespace joulecast::api {
namespace {

constexpr std::int64_t max_recent_robots = 200;  // a page

struct RecentAnswer {
  std::string robot_id;
  const std::vector<ingest::RecentValue>& values;
};

auto of_each(auto get) {
  return [get](const RecentAnswer& a) { return a.values | std::views::transform(get); };
}

const auto recent_table =
    Table<RecentAnswer>()
        .value("robot_id", AT(robot_id), "robot of the values")
        .integers("utime_us", of_each(AT(utime_us)),
                  "µs since the Unix epoch by the robot's clock, ascending, about one a second; as long as "
                  "the other columns")
        .all_digits("measured_power_w", of_each(AT(measured_power_w)),
                    "W, from the battery by the sensors; null: not measured")
        .all_digits("modelled_power_w", of_each(AT(modelled_power_w)),
                    "W, from the battery by the model; null: no model")
        .all_digits("speed_m_s", of_each(AT(speed_m_s)), "m/s, forward")
        .all_digits("x_m", of_each(AT(pose[0])), "m, in the robot's map frame; null: not reported")
        .all_digits("y_m", of_each(AT(pose[1])), "m, in the robot's map frame; null: not reported")
        .all_digits("heading_rad", of_each(AT(pose[2])),
                    "rad, counterclockwise from the map's x axis; null: not reported");

Result<Response> recent(const Services& services, const Request& request) {
  TRY_ASSIGN(const auto chosen, robot_ids_of(request));
  std::set<std::string> ids(chosen.begin(), chosen.end());
  if (ids.empty())
    for (const auto& snapshot : services.fleet.all()) ids.insert(snapshot->robot_id);
  const auto [page, next] = page_of_ids(request, ids);
  const auto write = [&](JsonWriter& json, const std::string& id) {
    recent_table.write(json, {id, services.recent.of(id)});
  };
  return page_response("robots", page, write, next, [](JsonWriter& json) {
    json.field("window_s", static_cast<double>(ingest::recent_window_us) / 1e6);
  });
}

}  // namespace

Part recent_value_part() {
  Rows rows;
  rows.add(Method::get, "/v1/recent-values", "listRecentValues", Role::read,
           "The last 90 s of robots' live values in columns, one a second, for charts that begin filled; "
           "kept in memory since the daemon's start",
           "recent-values", recent,
           {.parameters = {{.name = "robot_id",
                            .description = "only this robot, or these, separated by commas; a robot that was "
                                           "not heard has empty columns"},
                           limit_parameter("robots a page", max_recent_robots, max_recent_robots),
                           cursor_parameter()},
            .rounded = true});
  const Schema window = described::with_words(described::of_type("number"), "s, greatest age of the values");
  return {std::move(rows),
          {{"recent-values", described::of_page("The last live values of robots, in columns", "robots",
                                                "by id", recent_table.of_member(), {{"window_s", window}})}}};
}

}  // namespace joulecast::api
