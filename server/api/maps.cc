#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "base/json_fields.h"
#include "base/try.h"
#include "robot/robot_fields.h"
#include "server/api/change.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// Floor plans by map and level, and the map and level on which each robot drives.
namespace joulecast::api {
namespace {

using history::FloorPlan;

constexpr const char* place_topic = "place";  // of the robot's settings in the store
// Of a map or level, as a covariate can name it.
constexpr std::size_t longest_name = 47;
constexpr const char* name_rule = "must be 1 to 47 of A-Z a-z 0-9 . _ -";
constexpr std::uint64_t most_plan_bytes = 4'000'000;
constexpr std::size_t most_chargers = 1000;  // of a level

struct Place {
  std::string map, level;
};

struct RobotPlace {
  std::string robot_id;
  Place place;
  bool reported = false;
};

struct Maps {
  std::vector<FloorPlan> levels;
  std::vector<RobotPlace> robots;
};

const auto place_table =
    Table<Place>("The map and level on which a robot drives", "")
        .text_or_null("map", AT(map), "name of the map, 1 to 47 of A-Z a-z 0-9 . _ -; null: none")
        .text_or_null("level", AT(level), "name of the level on the map, of the same; null: none");

const auto charger_table = Table<std::array<double, 2>>()
                               .value("x_m", AT(at(0)), "place in the map")
                               .value("y_m", AT(at(1)), "place in the map");
const auto plan_table =
    Table<FloorPlan>("Plan of one level of a map")
        .value("map", AT(map), "name of the map")
        .value("level", AT(level), "name of the level")
        .time("changed", AT(utime_us), "time of the upload")
        .value("media_type", AT(media_type), "of the image", {{"enum", {"image/png", "image/svg+xml"}}})
        .value("resolution_m", AT(resolution_m), "side of a pixel of the image, m")
        .value("origin_x_m", AT(origin_x_m), "place of the image's lower left corner in the map")
        .value("origin_y_m", AT(origin_y_m), "place of the image's lower left corner in the map")
        .value("origin_yaw_rad", AT(origin_yaw_rad),
               "rotation of the image about that corner, counterclockwise")
        .list("chargers", AT(chargers), "places of chargers", charger_table);

const auto robot_place_table =
    Table<RobotPlace>()
        .value("robot_id", AT(robot_id), "the robot's id, as in its telemetry")
        .include(place_table, AT(place))
        .value("reported", AT(reported),
               "true: by the robot's covariates map=NAME and level=NAME, which override its settings");
const auto maps_table = Table<Maps>("Floor plans, and the map and level of every robot")
                            .list("levels", AT(levels), "levels with a plan, by map and level", plan_table)
                            .list("robots", AT(robots), "all robots, by id", robot_place_table);

// The settings of the robots that have some.
Result<std::map<std::string, Place>> places_of(const history::Store& store) {
  TRY_ASSIGN(const auto stored, store.all_learned(place_topic));
  std::map<std::string, Place> places;
  for (const history::Learned& each : stored) {
    const auto body = nlohmann::json::parse(each.body_json);
    places[each.robot_id] = {body.value("map", ""), body.value("level", "")};
  }
  return places;
}

RobotPlace place_of(const Services& services, const std::string& robot_id, Place settings) {
  RobotPlace found{robot_id, std::move(settings), false};
  const auto snapshot = services.fleet.find(robot_id);
  if (snapshot == nullptr) return found;
  for (const auto& [label, name] :
       {std::pair(&snapshot->map, &found.place.map), {&snapshot->level, &found.place.level}}) {
    if (label->empty()) continue;
    *name = *label;
    found.reported = true;
  }
  return found;
}

Result<Response> list_maps(const Services& services, const Request&) {
  Maps maps;
  TRY_ASSIGN(maps.levels, services.store.floor_plans());
  std::set<std::string> ids;
  for (const auto& model : services.models.all()) ids.insert(model->robot.robot_id);
  for (const auto& snapshot : services.fleet.all()) ids.insert(snapshot->robot_id);
  TRY_ASSIGN(auto settings, places_of(services.store));
  for (const std::string& id : ids) maps.robots.push_back(place_of(services, id, settings[id]));
  return http::json_response(maps_table.text(maps));
}

Result<Response> put_place(Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY(model_of(services, id));
  Fields fields(*request.json);
  Place place;
  for (const auto& [key, name] : {std::pair("map", &place.map), {"level", &place.level}}) {
    *name = fields.text(key, longest_name, "");
    if (fields.ok() && !name->empty() && !robot::is_robot_id(*name)) fields.fault(key, name_rule);
  }
  TRY(fields.finish());
  const nlohmann::json body{{"map", place.map}, {"level", place.level}};
  return RequestChange(services, request)
      .execute(history::PutLearned{{id, place_topic, services.now_utime_us(), body.dump()}},
               place_table.text(place));
}

Result<FloorPlan> named(const Request& request) {
  FloorPlan plan;
  plan.map = request.param("map");
  plan.level = request.param("level");
  for (const auto& [field, name] : {std::pair("map", &plan.map), {"level", &plan.level}})
    if (!robot::is_robot_id(*name)) return invalid(field, name_rule);
  return plan;
}

Result<std::vector<std::array<double, 2>>> chargers_of(const Request& request) {
  std::vector<std::array<double, 2>> chargers;
  std::istringstream listed{std::string(request.query_value("chargers").value_or(""))};
  for (std::string place; std::getline(listed, place, ';');) {
    const auto at = nlohmann::json::parse("[" + place + "]", nullptr, false);
    if (!at.is_array() || at.size() != 2 || !at[0].is_number() || !at[1].is_number() ||
        chargers.size() == most_chargers)
      return invalid("chargers", fmt::format("must be x,y;x,y in metres, at most {} places", most_chargers));
    chargers.push_back({at[0].get<double>(), at[1].get<double>()});
  }
  return chargers;
}

bool is_of_type(std::string_view image, std::string_view type) {
  if (type == "image/png") return image.starts_with("\x89PNG\r\n\x1a\n");
  return type == "image/svg+xml" && image.substr(0, 4096).find("<svg") != std::string_view::npos;
}

Result<Response> put_plan(Services& services, const Request& request) {
  TRY_ASSIGN(FloorPlan plan, named(request));
  plan.utime_us = services.now_utime_us();
  plan.resolution_m = *request.query_number("resolution_m");
  plan.origin_x_m = request.query_number("origin_x_m").value_or(0);
  plan.origin_y_m = request.query_number("origin_y_m").value_or(0);
  plan.origin_yaw_rad = request.query_number("origin_yaw_rad").value_or(0);
  TRY_ASSIGN(plan.chargers, chargers_of(request));
  plan.media_type = request.header("content-type");
  if (!is_of_type(request.body, plan.media_type))
    return invalid("Content-Type", "must be image/png or image/svg+xml, and the body such an image");
  std::string text = plan_table.text(plan);
  plan.image = request.body;
  return RequestChange(services, request).execute(history::PutFloorPlan{std::move(plan)}, std::move(text));
}

Result<Response> remove_plan(Services& services, const Request& request) {
  TRY_ASSIGN(FloorPlan plan, named(request));
  std::string text = place_table.text({plan.map, plan.level});
  return RequestChange(services, request).execute(history::PutFloorPlan{std::move(plan)}, std::move(text));
}

Result<Response> get_plan(const Services& services, const Request& request) {
  TRY_ASSIGN(FloorPlan plan, services.store.floor_plan(request.param("map"), request.param("level")));
  Response response;
  response.content_type = std::move(plan.media_type);
  response.body = std::move(plan.image);
  // An image may be opened by its address: its scripts do not run.
  response.headers.emplace_back("Content-Security-Policy", "sandbox; default-src 'none'");
  return response;
}

}  // namespace

Part map_part() {
  constexpr const char* path = "/v1/maps/{map}/levels/{level}";
  constexpr auto number = Parameter::Type::number;
  Rows rows;
  rows.add(Method::get, "/v1/maps", "listMaps", Role::read,
           "Floor plans, and the map and level on which each robot drives", "maps", list_maps);
  rows.add(Method::get, path, "getFloorPlan", Role::read, "The image of a floor plan", "", get_plan,
           {.response_type = "image/*", .etag = true, .error_statuses = {404}});
  rows.add(
      Method::put, path, "putFloorPlan", Role::admin,
      "Stores the floor plan of a level: a PNG or SVG image of at most 4 MB, with its scale and origin as in "
      "a map.yaml of ROS",
      "floor-plan", put_plan,
      {.parameters =
           {{.name = "resolution_m",
             .type = number,
             .description = "side of a pixel of the image, m",
             .minimum = 1e-4,
             .maximum = 100,
             .required = true},
            bounded(number, "origin_x_m", "the image's lower left corner in the map; 0 if absent", -1e6, 1e6),
            bounded(number, "origin_y_m", "the image's lower left corner in the map; 0 if absent", -1e6, 1e6),
            bounded(number, "origin_yaw_rad", "rotation of the image about that corner; 0 if absent", -7, 7),
            {.name = "chargers", .description = "places of chargers in the map, m, as x,y;x,y"}},
       .request_types = {"image/png", "image/svg+xml"},
       .max_body_bytes = most_plan_bytes,
       .error_statuses = {413, 422},
       .run = Run::write});
  rows.add(Method::del, path, "removeFloorPlan", Role::admin, "Deletes the floor plan of a level",
           "robot-place", remove_plan, {.error_statuses = {404, 422}, .run = Run::write});
  rows.add(
      Method::put, "/v1/robots/{id}/place", "putRobotPlace", Role::operate,
      "Sets the map and level on which a robot drives; its covariates map=NAME and level=NAME override them",
      "robot-place", put_place,
      {.request_schema = "robot-place", .error_statuses = {404, 422}, .run = Run::write});
  return {std::move(rows),
          {{"floor-plan", plan_table.schema()},
           {"maps", maps_table.schema()},
           {"robot-place", place_table.schema()}}};
}

}  // namespace joulecast::api
