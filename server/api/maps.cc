#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "answers/floor_map.h"
#include "base/json_fields.h"
#include "base/try.h"
#include "robot/robot_fields.h"
#include "server/api/change.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// Floor plans by map and level, the map and level on which each robot drives, and energy and gap by floor
// square, over the missions of a period.
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

using answers::FloorCell;
using answers::FloorMap;
using answers::FloorZone;

constexpr std::int64_t most_cells = 20'000;   // largest accepted limit
constexpr std::int64_t usual_cells = 10'000;  // default limit
constexpr double usual_cell_m = 1;

double ratio(double measured_j, double modelled_j) {
  return modelled_j > 0 ? measured_j / modelled_j : signals::unmeasured;
}

struct Square {
  const FloorCell& cell;
  double side_m;
};

struct FloorAnswer {
  const FloorMap& map;
  std::size_t limit;
};

struct FloorBounds {
  double x_min_m, y_min_m, x_max_m, y_max_m;
};

std::optional<FloorBounds> bounds_of(const FloorAnswer& answer) {
  const FloorMap& map = answer.map;
  if (map.cells.empty()) return std::nullopt;
  const auto [left, right] = std::ranges::minmax(map.cells, {}, &FloorCell::x_m);
  const auto [low, high] = std::ranges::minmax(map.cells, {}, &FloorCell::y_m);
  return FloorBounds{left.x_m, low.y_m, right.x_m + map.cell_m, high.y_m + map.cell_m};
}

std::vector<Square> squares_of(const FloorAnswer& answer) {
  std::vector<Square> squares;
  for (std::size_t k = 0; k < std::min(answer.limit, answer.map.cells.size()); ++k)
    squares.push_back({answer.map.cells[k], answer.map.cell_m});
  return squares;
}

const Schema at_least_0{{"minimum", 0}};

const auto square_table =
    Table<Square>()
        .value("x_m", AT(cell.x_m), "m, the square's corner of least coordinates, in the robots' map frame")
        .value("y_m", AT(cell.y_m), "m, likewise")
        .value("missions", AT(cell.missions), "missions that crossed it", at_least_0)
        .value("robots", AT(cell.robots), "robots that crossed it", at_least_0)
        .value("covered_s", AT(cell.covered_s), "s, spent in it", at_least_0)
        .value("distance_m", AT(cell.distance_m), "m, driven in it", at_least_0)
        .value("energy_j", AT(cell.energy_j), "J, from the battery: measured where available, else modelled")
        .number_or_null(
            "energy_j_per_m", [](const Square& s) { return s.cell.energy_per_distance_j_m(s.side_m); },
            "J/m while driving; null where less than half a side was driven")
        .value("measured_j", AT(cell.measured_j),
               "J, measured by the sensors in the seconds of driving that have both measured and modelled "
               "power")
        .value("modelled_j", AT(cell.modelled_j), "J, by the models, over the same seconds")
        .number_or_null(
            "ratio", [](const Square& s) { return ratio(s.cell.measured_j, s.cell.modelled_j); },
            "measured_j / modelled_j; null where the latter is not positive")
        .number_or_null("departure", AT(cell.departure),
                        "relative excess of measured energy over modelled energy times the usual ratio of "
                        "each mission; null: too few missions measured here")
        .numbers("departure_ci", AT(cell.interval), "95 % interval of departure, with missions as the units")
        .value("stands_out", AT(cell.stands_out),
               "departs by 5 % or more, and significantly, allowing for the number of squares");

const auto zone_table =
    Table<FloorZone>()
        .value("x_min_m", AT(x_min_m), "m, left of the zone")
        .value("y_min_m", AT(y_min_m), "m, below the zone")
        .value("x_max_m", AT(x_max_m), "m, right of the zone")
        .value("y_max_m", AT(y_max_m), "m, above the zone")
        .value("cells", AT(cells), "squares in it", at_least_0)
        .value("covered_s", AT(covered_s), "s, spent in it", at_least_0)
        .value("distance_m", AT(distance_m), "m, driven in it", at_least_0)
        .value("departure", AT(departure), "departure of the zone, defined as that of a square")
        .value("excess_j", AT(excess_j), "J, in excess of the expected energy, in the evaluated missions");
const auto bounds_table = Table<FloorBounds>()
                              .value("x_min_m", AT(x_min_m), "m, left of all squares")
                              .value("y_min_m", AT(y_min_m), "m, below all squares")
                              .value("x_max_m", AT(x_max_m), "m, right of all squares")
                              .value("y_max_m", AT(y_max_m), "m, above all squares");
const auto floor_map_table =
    Table<FloorAnswer>("Energy and gap by floor square")
        .value("cell_m", AT(map.cell_m), "m, side of a square", {{"exclusiveMinimum", 0}})
        .value("missions", AT(map.reading.missions),
               "missions that started in the period, without annulled and contradicted ones", at_least_0)
        .value("missions_read", AT(map.reading.missions_read),
               "evaluated missions: all, or an evenly distributed sample; the sums are of these", at_least_0)
        .value("seconds_read", AT(map.reading.points), "evaluated seconds of their traces", at_least_0)
        .texts("robots", AT(map.robots), "robots of the evaluated missions")
        .value("covered_s", AT(map.covered_s), "s, in all squares", at_least_0)
        .value("distance_m", AT(map.distance_m), "m, in all squares", at_least_0)
        .value("energy_j", AT(map.energy_j), "J, in all squares")
        .value("measured_j", AT(map.measured_j), "J, sum of measured_j of all squares")
        .value("modelled_j", AT(map.modelled_j), "J, sum of modelled_j of all squares")
        .number_or_null(
            "ratio", [](const FloorAnswer& a) { return ratio(a.map.measured_j, a.map.modelled_j); },
            "measured_j / modelled_j")
        .object("bounds", bounds_of, "of the driven floor; null: no position is stored", bounds_table)
        .list("zones", AT(map.zones),
              "groups of adjacent squares with a departure of the same sign, in descending order of excess "
              "energy",
              zone_table)
        .value("cells_total", AT(map.cells.size()), "number of squares, of which at most limit are listed",
               at_least_0)
        .list("cells", squares_of, "the longest visited first", square_table);

Result<Response> floor_map(const Services& services, const Request& request) {
  history::MissionFilter filter;
  TRY_ASSIGN(filter.robot_ids, robot_ids_of(request));
  TRY_ASSIGN(filter.started, range_of(request));
  const double cell_m = request.query_number("cell_m").value_or(usual_cell_m);
  answers::FloorMapper mapper(cell_m);
  TRY_ASSIGN(const auto read, services.store.floor_visits(filter, cell_m, history::max_floor_points,
                                                          [&](const history::FloorMission& mission) {
                                                            return !request.stop.stop_requested() &&
                                                                   mapper.add(mission);
                                                          }));
  TRY_ASSIGN(const auto map, mapper.finish(read));
  const auto limit = static_cast<std::size_t>(*request.query_integer("limit"));
  if (request.csv)
    return csv_response(
        request, "floor-map",
        "x_m y_m missions robots covered_s distance_m energy_j energy_j_per_m measured_j modelled_j ratio "
        "departure departure_low=departure_ci/0 departure_high=departure_ci/1 stands_out",
        squares_of({map, limit}), square_table);
  return http::json_response(floor_map_table.text({map, limit}));
}

}  // namespace

Part map_part() {
  constexpr const char* path = "/v1/maps/{map}/levels/{level}";
  constexpr auto number = Parameter::Type::number;
  Part part;
  part.add(Method::get, "/v1/maps", "listMaps", Role::read,
           "Floor plans, and the map and level on which each robot drives", {"maps", maps_table.schema()},
           list_maps);
  part.add(Method::get, path, "getFloorPlan", Role::read, "The image of a floor plan", {}, get_plan,
           {.response_type = "image/*", .etag = true, .error_statuses = {404}});
  part.add(
      Method::put, path, "putFloorPlan", Role::admin,
      "Stores the floor plan of a level: a PNG or SVG image of at most 4 MB, with its scale and origin as in "
      "a map.yaml of ROS",
      {"floor-plan", plan_table.schema()}, put_plan,
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
       .error_statuses = {413},
       .run = Run::write});
  part.add(Method::del, path, "removeFloorPlan", Role::admin, "Deletes the floor plan of a level",
           {"robot-place"}, remove_plan, {.error_statuses = {404, 422}, .run = Run::write});
  part.add(
      Method::put, "/v1/robots/{id}/place", "putRobotPlace", Role::operate,
      "Sets the map and level on which a robot drives; its covariates map=NAME and level=NAME override them",
      {"robot-place", place_table.schema()}, put_place,
      {.request_schema = "robot-place", .error_statuses = {404}, .run = Run::write});
  return part;
}

Part floor_map_part() {
  Part part;
  part.add(Method::get, "/v1/floor-map", "mapFloor", Role::read,
           "Energy and gap by floor square, from the traces of missions, with zones of significant "
           "departure; of a history of more than a million seconds an evenly distributed sample of the "
           "missions is evaluated",
           {"floor-map", floor_map_table.schema()}, floor_map,
           {.parameters = with(
                range_parameters("missions that started"),
                {{.name = "robot_id",
                  .description = "only this robot, or these, separated by commas: those that share a map"},
                 bounded(Parameter::Type::number, "cell_m", "side of a square, m; 1 if absent",
                         history::least_floor_cell_m, history::greatest_floor_cell_m),
                 limit_parameter("squares, the longest visited first", usual_cells, most_cells)}),
            .csv = true,
            .rounded = true});
  return part;
}

}  // namespace joulecast::api
