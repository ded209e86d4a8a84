#include "answers/floor_map.h"

#include <algorithm>

#include "base/try.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// Energy and gap by floor square, over the missions of a period.
namespace joulecast::api {
namespace {

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
    return csv_response(request, "floor-map",
                        {"x_m", "y_m", "missions", "robots", "covered_s", "distance_m", "energy_j",
                         "energy_j_per_m", "measured_j", "modelled_j", "ratio", "departure",
                         "departure_low=departure_ci/0", "departure_high=departure_ci/1", "stands_out"},
                        squares_of({map, limit}), square_table);
  return http::json_response(floor_map_table.text({map, limit}));
}

}  // namespace

Part floor_map_part() {
  Rows rows;
  rows.add(Method::get, "/v1/floor-map", "mapFloor", Role::read,
           "Energy and gap by floor square, from the traces of missions, with zones of significant "
           "departure; of a history of more than a million seconds an evenly distributed sample of the "
           "missions is evaluated",
           "floor-map", floor_map,
           {.parameters = with(
                range_parameters("missions that started"),
                {{.name = "robot_id",
                  .description = "only this robot, or these, separated by commas: those that share a map"},
                 bounded(Parameter::Type::number, "cell_m", "side of a square, m; 1 if absent",
                         history::least_floor_cell_m, history::greatest_floor_cell_m),
                 limit_parameter("squares, the longest visited first", usual_cells, most_cells)}),
            .csv = true,
            .rounded = true});
  return {std::move(rows), {{"floor-map", floor_map_table.schema()}}};
}

}  // namespace joulecast::api
