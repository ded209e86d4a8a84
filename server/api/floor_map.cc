#include "answers/floor_map.h"

#include <algorithm>
#include <limits>

#include "base/json_writer.h"
#include "base/try.h"
#include "server/api/common_parameters.h"
#include "server/api/csv.h"
#include "server/api/services.h"

// Energy and gap by squares of the floor, over the missions of a period.
namespace joulecast::api {
namespace {

using answers::FloorCell;
using answers::FloorMap;
using answers::FloorZone;
using http::Method;
using http::Parameter;
using http::Request;
using http::Response;

constexpr std::int64_t most_cells = 20'000;   // largest accepted limit
constexpr std::int64_t usual_cells = 10'000;  // default limit
constexpr double usual_cell_m = 1;

double ratio(double measured_j, double modelled_j) {
  return modelled_j > 0 ? measured_j / modelled_j : signals::unmeasured;
}

void write_bounds(JsonWriter& json, const FloorMap& map) {
  json.key("bounds");
  if (map.cells.empty()) {
    json.null();
    return;
  }
  const auto [left, right] = std::ranges::minmax(map.cells, {}, &FloorCell::x_m);
  const auto [low, high] = std::ranges::minmax(map.cells, {}, &FloorCell::y_m);
  json.begin_object().field("x_min_m", left.x_m).field("y_min_m", low.y_m);
  json.field("x_max_m", right.x_m + map.cell_m).field("y_max_m", high.y_m + map.cell_m).end_object();
}

void write_cell(JsonWriter& json, const FloorCell& cell, double cell_m) {
  json.begin_object().field("x_m", cell.x_m).field("y_m", cell.y_m);
  json.field("missions", cell.missions).field("robots", cell.robots);
  json.field("covered_s", cell.covered_s).field("distance_m", cell.distance_m);
  json.field("energy_j", cell.energy_j).field("energy_j_per_m", cell.energy_per_distance_j_m(cell_m));
  json.field("measured_j", cell.measured_j).field("modelled_j", cell.modelled_j);
  json.field("ratio", ratio(cell.measured_j, cell.modelled_j)).field("departure", cell.departure);
  json.array("departure_ci", cell.interval).field("stands_out", cell.stands_out).end_object();
}

void write_zone(JsonWriter& json, const FloorZone& zone) {
  json.begin_object().field("x_min_m", zone.x_min_m).field("y_min_m", zone.y_min_m);
  json.field("x_max_m", zone.x_max_m).field("y_max_m", zone.y_max_m).field("cells", zone.cells);
  json.field("covered_s", zone.covered_s).field("distance_m", zone.distance_m);
  json.field("departure", zone.departure).field("excess_j", zone.excess_j).end_object();
}

std::string json_of(const FloorMap& map, std::size_t limit) {
  JsonWriter json;
  json.begin_object().field("cell_m", map.cell_m).field("missions", map.reading.missions);
  json.field("missions_read", map.reading.missions_read).field("seconds_read", map.reading.points);
  json.array("robots", map.robots).field("covered_s", map.covered_s).field("distance_m", map.distance_m);
  json.field("energy_j", map.energy_j).field("measured_j", map.measured_j);
  json.field("modelled_j", map.modelled_j).field("ratio", ratio(map.measured_j, map.modelled_j));
  write_bounds(json, map);
  json.key("zones").begin_array();
  for (const FloorZone& zone : map.zones) write_zone(json, zone);
  json.end_array().field("cells_total", static_cast<std::int64_t>(map.cells.size()));
  json.key("cells").begin_array();
  for (std::size_t k = 0; k < std::min(limit, map.cells.size()); ++k)
    write_cell(json, map.cells[k], map.cell_m);
  json.end_array().end_object();
  return json.take();
}

Response csv_of(const Request& request, const FloorMap& map, std::size_t limit) {
  Csv csv(request, {"x_m", "y_m", "missions", "robots", "covered_s", "distance_m", "energy_j",
                    "energy_j_per_m", "measured_j", "modelled_j", "ratio", "departure", "departure_low",
                    "departure_high", "stands_out"});
  for (std::size_t k = 0; k < std::min(limit, map.cells.size()); ++k) {
    const FloorCell& cell = map.cells[k];
    csv.field(cell.x_m).field(cell.y_m).field(cell.missions).field(cell.robots).field(cell.covered_s);
    csv.field(cell.distance_m).field(cell.energy_j).field(cell.energy_per_distance_j_m(map.cell_m));
    csv.field(cell.measured_j).field(cell.modelled_j).field(ratio(cell.measured_j, cell.modelled_j));
    csv.field(cell.departure).field(cell.interval[0]).field(cell.interval[1]).field(cell.stands_out);
    csv.end_row();
  }
  return csv.response("floor-map");
}

Result<Response> floor_map(const Services& services, const Request& request) {
  history::MissionFilter filter;
  TRY_ASSIGN(auto robots, robot_ids_of(request));
  filter.robot_ids = std::move(robots);
  TRY_ASSIGN(const auto from, time_of(request, "from"));
  TRY_ASSIGN(const auto to, time_of(request, "to"));
  filter.start_from_utime_us = from;
  filter.start_to_utime_us = to;
  const double cell_m = request.query_number("cell_m").value_or(usual_cell_m);
  answers::FloorMapper mapper(cell_m);
  const auto read = services.store.floor_visits(
      filter, cell_m, history::max_floor_points, [&](const history::FloorMission& mission) {
        return !request.stop.stop_requested() && mapper.add(mission);
      });
  if (!read) return tl::unexpected(read.error());
  TRY_ASSIGN(const auto map, mapper.finish(*read));
  const auto limit = static_cast<std::size_t>(request.query_integer("limit").value_or(usual_cells));
  if (request.csv) return csv_of(request, map, limit);
  return http::json_response(json_of(map, limit));
}

}  // namespace

std::vector<TableRow> floor_map_rows() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = Method::get,
        .path = "/v1/floor-map",
        .operation_id = "mapFloor",
        .role = http::Role::read,
        .summary = "Energy and gap by squares of the floor, from the traces of missions, with zones of "
                   "significant departure; of a history of more than a million seconds an evenly "
                   "distributed sample of the missions is evaluated",
        .parameters =
            with(with(time_parameters("from", "only missions that started at or after this time"),
                      time_parameters("to", "only missions that started before this time")),
                 {{.name = "robot_id",
                   .type = Parameter::Type::text,
                   .description = "only this robot, or these, separated by commas: those that share a map"},
                  {.name = "cell_m",
                   .type = Parameter::Type::number,
                   .description = "side of a square, m; 1 if absent",
                   .minimum = history::least_floor_cell_m,
                   .maximum = history::greatest_floor_cell_m},
                  limit_parameter("squares, the longest visited first; 10000 if absent", most_cells)}),
        .response_schema = "floor-map",
        .csv = true,
        .rounded = true},
       answered_by(floor_map)});
  return rows;
}

}  // namespace joulecast::api
