#include "answers/drive.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace joulecast::answers {

Result<planning::Path> path_of(const Way& way, const planning::PathOptions& options) {
  Result<planning::Path> path = planning::make_path(way.path, options);
  if (path) return path;
  // make_path() names "/segments/3/...", which are the input's "/path/3/...".
  constexpr std::string_view given = "/segments";
  if (std::string& field = path.error().field; field.starts_with(given))
    field.replace(0, given.size(), "/path");
  return path;
}

bool is_brief(const std::vector<planning::Segment>& segments) {
  constexpr double short_arc_m = 20;  // 400 knots
  int motions = 0;
  for (const planning::Segment& segment : segments) {
    if (std::holds_alternative<planning::Dwell>(segment) ||
        std::holds_alternative<planning::PayloadChange>(segment))
      continue;
    const auto* arc = std::get_if<planning::Arc>(&segment);
    const bool simple = std::holds_alternative<planning::Straight>(segment) ||
                        std::holds_alternative<planning::TurnInPlace>(segment) ||
                        (arc != nullptr && arc->radius_m * std::fabs(arc->angle_rad) <= short_arc_m);
    if (!simple || ++motions > 1) return false;
  }
  return motions == 1;
}

namespace {

using described::Input;
using described::Presence;
using described::Table;
using planning::Limits;
using planning::Pose;

constexpr std::size_t max_points = 100'000;
constexpr double max_length_m = 1e5;
constexpr double max_arc_rad = 100 * std::numbers::pi;
// More turns on the spot end at no other heading; usual angles in degrees are greater.
constexpr double max_turn_rad = 4 * std::numbers::pi;
constexpr Bounds length{.minimum = 1e-6, .maximum = max_length_m};
constexpr Bounds straight_length{.minimum = 0, .maximum = max_length_m};
constexpr Bounds curvature{.minimum = -1e3, .maximum = 1e3};
constexpr Bounds arc{.minimum = -max_arc_rad, .maximum = max_arc_rad};
constexpr Bounds turn{.minimum = -max_turn_rad, .maximum = max_turn_rad};
constexpr described::Count segments_of_path{1, 10'000, "segments"};

template <class Form>
using Part = Input<Form, PathContext>;

// The lesser of the robot's own limit and the given one.
auto tightened(double Limits::*limit) {
  return [limit](Limits& limits, std::optional<double> own) {
    if (own) limits.*limit = std::min(limits.*limit, *own);
  };
}

const described::Variants<planning::Segment, PathContext>& segments() {
  using namespace planning;
  constexpr const char* length_words = "length; for a detour, of the straight line";
  static const auto point = point_input<planning::Point>("place on the map");
  static const auto forms =
      described::Variants<Segment, PathContext>("kind")
          .of("straight", "a straight",
              Part<Straight>().number("length_m", &Straight::length_m, length, length_words))
          .of("turn", "a turn on the spot",
              Part<TurnInPlace>().number("angle_rad", &TurnInPlace::angle_rad, turn, "positive to the left"))
          .of("arc", "an arc of a circle",
              Part<Arc>()
                  .number("radius_m", &Arc::radius_m, length, "radius of the arc")
                  .number("angle_rad", &Arc::angle_rad, arc, "positive to the left"))
          .of("polyline", "straights from point to point, turning on the spot between them",
              Part<Polyline>()
                  .list("points", &Polyline::points, {1, max_points, "points"}, "points after the start",
                        point)
                  .number("heading_rad", &Polyline::heading_rad, heading_bounds_rad,
                          "heading to which the robot turns at the end; default: its heading on arrival"))
          .of("bezier", "a cubic Bezier curve",
              Part<Bezier>()
                  .object("control_1", &Bezier::control_1, "control point 1", point)
                  .object("control_2", &Bezier::control_2, "control point 2", point)
                  .object("end", &Bezier::end, "end of the curve", point))
          .of("gaussian_detour", "a straight line with a lateral deviation of Gaussian shape",
              Part<GaussianDetour>()
                  .number("length_m", &GaussianDetour::length_m, length, length_words)
                  .number("amplitude_m", &GaussianDetour::amplitude_m, position_bounds_m,
                          "greatest deviation, positive to the left")
                  .number("centre_m", &GaussianDetour::centre_m, position_bounds_m,
                          "position of the greatest deviation along the straight")
                  .number("width_m", &GaussianDetour::width_m, length, "standard deviation of the Gaussian"))
          .of("clothoid", "a clothoid: curvature is linear in the distance",
              Part<Clothoid>()
                  .number("length_m", &Clothoid::length_m, length, length_words)
                  .number("start_curvature_1_m", &Clothoid::start_curvature_1_m, curvature,
                          "curvature at the start, positive to the left")
                  .number("end_curvature_1_m", &Clothoid::end_curvature_1_m, curvature,
                          "curvature at the end"))
          .of("curvature", "a curve given by its curvature over the distance",
              Part<SampledCurvature>()
                  .numbers("way_m", &SampledCurvature::way_m, {2, max_points}, not_negative,
                           "distance of each point from the start, ascending from 0")
                  .numbers("curvature_1_m", &SampledCurvature::curvature_1_m, {2, max_points}, curvature,
                           "curvature there, positive to the left; linear between points"))
          .of("dwell", "rest",
              Part<Dwell>().number("duration_s", &Dwell::duration_s, dwell_bounds_s, "duration"))
          .of("payload", "change of payload",
              Part<PayloadChange>().number("payload_kg", &PayloadChange::payload_kg, not_negative,
                                           "payload from here on; at most the robot's limit", {},
                                           payload_limit<PayloadChange>));
  return forms;
}

const Input<Limits>& limits_input() {
  static const auto input =
      Input<Limits>("Limits of a motion")
          .named("limits")
          .number("speed_m_s", tightened(&Limits::speed_m_s), positive, "greatest speed; null: the robot's")
          .number("acceleration_m_s2", tightened(&Limits::acceleration_m_s2), positive,
                  "greatest acceleration; null: the robot's")
          .number("yaw_rate_rad_s", tightened(&Limits::yaw_rate_rad_s), positive,
                  "greatest rate of turning; null: the robot's")
          .number("wheel_speed_rad_s", tightened(&Limits::wheel_speed_rad_s), positive,
                  "greatest speed of a wheel; null: no limit")
          .number("current_a", tightened(&Limits::current_a), positive,
                  "greatest motor current; null: the robot's")
          .number("voltage_v", tightened(&Limits::voltage_v), positive,
                  "greatest motor voltage; null: the battery's nominal voltage")
          .number(
              "least_speed_m_s",
              [](Limits& limits, std::optional<double> own) { limits.least_speed_m_s = own.value_or(0); },
              positive,
              "least speed along the way, except near starts and stops, for vehicles that cannot creep; "
              "null: none");
  return input;
}

using WayInput = Part<Way>;

// Straights and turns on the spot in alternation, in place of a path.
void read_legs(Fields& fields, Way& way, PathContext& context) {
  const bool drives = fields.member("distances_m") != nullptr, turns = fields.member("turns_rad") != nullptr;
  if (!drives && !turns && !context.may_stand) fields.required("path");
  way.member = drives ? "distances_m" : turns ? "turns_rad" : way.member;
  std::vector<double> lengths, angles;
  if (drives) lengths = fields.numbers("distances_m", 0, segments_of_path.maximum, straight_length);
  if (turns) angles = fields.numbers("turns_rad", 0, segments_of_path.maximum, turn);
  for (std::size_t k = 0; k < std::max(lengths.size(), angles.size()); ++k) {
    way.path.emplace_back(planning::Dwell{0});  // ends the straight before
    if (k < lengths.size() && lengths[k] >= planning::same_place_m)
      way.path.emplace_back(planning::Straight{lengths[k]});
    if (k < angles.size() && angles[k] != 0) way.path.emplace_back(planning::TurnInPlace{angles[k]});
  }
  const auto zero = [](double amount) { return std::fabs(amount) < planning::same_place_m; };
  const bool stands = std::ranges::all_of(lengths, zero);
  way.placed = turns || stands;
  if (fields.ok() && !context.may_stand && stands && std::ranges::all_of(angles, zero))
    fields.fault(drives ? "distances_m" : "turns_rad", "contains neither a distance nor a turn");
}

// There without payload, from there to the drop-off with it.
void read_stations(Fields& fields, Way& way, PathContext&) {
  const planning::Stations& at = *way.stations;
  if (!at.pickup) fields.required("pickup");
  if (!at.dropoff) fields.required("dropoff");
  const double payload_kg = fields.has("payload_kg") ? fields.number("payload_kg", not_negative) : 0;
  if (!fields.ok()) return;
  const auto towards = [](const planning::Station& to) {
    return planning::Polyline{{{to.x_m, to.y_m}}, to.heading_rad};
  };
  way.member = "pickup";
  way.path = {towards(*at.pickup),
              planning::Dwell{at.pickup_dwell_s.value_or(0)},
              planning::PayloadChange{payload_kg},
              towards(*at.dropoff),
              planning::Dwell{at.dropoff_dwell_s.value_or(0)},
              planning::PayloadChange{0}};
}

// A further segment, by a member of the version before.
template <class Segment>
auto former_segment() {
  return [](Way& way, std::optional<double> amount) {
    way.former = way.former || amount;
    if (amount.value_or(0) != 0) way.path.emplace_back(Segment{*amount});
  };
}

const Input<planning::Station>& station_input() {
  static const auto input =
      Input<planning::Station>("A place where a robot fetches or brings something")
          .named("station")
          .include(point_input<planning::Station>("place on the map"), std::identity())
          .number("heading_rad", &planning::Station::heading_rad, heading_bounds_rad,
                  "heading to which the robot turns there; default: its heading on arrival");
  return input;
}

described::Limit greatest_speed(const DriveInput& drive, const PathContext&) {
  return {drive.problem.limits.speed_m_s, "limits/speed_m_s"};
}

// Positions may be null where the start is not given.
Table<planning::Profile> make_columns(bool null_positions) {
  using P = planning::Profile;
  // Accelerations follow from these: their spans may last some tens of microseconds.
  constexpr int nano = 9;
  return Table<P>()
      .column("time_s", &P::time_s, "time since the start", nano)
      .column("distance_m", &P::distance_m, "distance from the start")
      .column("x_m", &P::x_m, "place on the map", 4, null_positions)
      .column("y_m", &P::y_m, "place on the map", 4, null_positions)
      .column("heading_rad", &P::heading_rad, heading_words, 5, null_positions)
      .column("speed_m_s", &P::speed_m_s, "forward speed; negative: backwards", nano)
      .column("yaw_rate_rad_s", &P::yaw_rate_rad_s, "rate of turning, positive to the left", nano)
      .column("acceleration_m_s2", &P::acceleration_m_s2, "forward acceleration")
      .column("yaw_acceleration_rad_s2", &P::yaw_acceleration_rad_s2, "change of the rate of turning")
      .column("payload_kg", &P::payload_kg, "payload from here on", 3)
      .all_digits("power_w", &P::power_w, "power drawn from the battery", false)
      .all_digits("energy_j", &P::energy_j, "drawn from the battery up to here", false);
}

}  // namespace

void refuse_beside_usual(Fields& fields, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (fields.has(name))
      fields.fault(name, "must not be combined with \"driving\": \"usual\", which is not planned");
}

described::Schemas drive_schemas() {
  described::Schema path = Part<DriveInput>::list_schema(segments_of_path, segments());
  path["title"] = "Parts of a path";
  path["description"] =
      "segments, one after another; a step of curvature between them is driven as two clothoids of 0.2 m "
      "together, or of half the length of the shorter segment";
  return {{"path", std::move(path)},
          {"station", described::or_null(station_input().schema())},
          {"pose", described::or_null(pose_input().schema())},
          {"limits", described::or_null(limits_input().schema())},
          {"quantiles", quantiles_table().schema()}};
}

const Input<Pose>& pose_input() {
  static const auto input = Input<Pose>("A place on the floor and a heading")
                                .named("pose")
                                .include(point_input<Pose>("place on the map"), std::identity())
                                .number("heading_rad", &Pose::heading_rad, heading_bounds_rad, heading_words);
  return input;
}

const Input<planning::Stations>& stations_input() {
  using planning::Stations;
  constexpr const char* dwell_words =
      "time at rest there. Of usual driving: if either dwell is stated, 0 included, the forecast contains no "
      "other halts; null: the usual ones";
  static const auto input =
      Input<Stations>()
          .object("pickup", &Stations::pickup,
                  "place of the pick-up: a turn towards it and a straight line from where the robot is",
                  station_input())
          .object("dropoff", &Stations::dropoff, "place of the drop-off, likewise from the pick-up",
                  station_input())
          .number("pickup_dwell_s", &Stations::pickup_dwell_s, dwell_bounds_s, dwell_words)
          .number("dropoff_dwell_s", &Stations::dropoff_dwell_s, dwell_bounds_s, dwell_words);
  return input;
}

const Input<Way, PathContext>& route_input() {
  const auto of_numbers = [](const Bounds& bounds) {
    return described::of_array(described::of_bounds(bounds),
                               described::of_count({0, segments_of_path.maximum}));
  };
  static const auto path = WayInput().list("path", &Way::path, segments_of_path, "the way to drive",
                                           segments(), Presence::required, "path");
  static const auto legs =
      WayInput()
          .custom(
              "distances_m", of_numbers(straight_length),
              "in place of path: lengths of straights, each from rest to rest, in alternation with turns_rad",
              read_legs)
          .custom("turns_rad", of_numbers(turn), "turns on the spot between them, positive to the left",
                  [](Fields&, Way&, PathContext&) {});
  static const auto input = WayInput().either(path, legs);
  return input;
}

const Input<Way, PathContext>& way_input() {
  static const auto stations =
      WayInput()
          .include(stations_input(), [](Way& way) -> planning::Stations& { return way.stations.emplace(); })
          .check(read_stations);
  static const auto input = WayInput().either(stations, route_input());
  return input;
}

const Input<Way, PathContext>& former_way_input() {
  static const auto input =
      WayInput()
          .number("turn_rad", former_segment<planning::TurnInPlace>(), turn, "turns_rad with one turn")
          .deprecated()
          .number("distance_m", former_segment<planning::Straight>(), {.minimum = 0, .maximum = 1e6},
                  "distances_m with one distance")
          .deprecated()
          .check([](Fields& fields, Way& way, PathContext&) {
            way.placed = way.placed && (fields.has("turn_rad") || !fields.has("distance_m"));
          });
  return input;
}

const Input<DriveInput, PathContext>& drive_input() {
  static const auto input =
      Part<DriveInput>()
          .object("limits", AT(problem.limits), "limits tighter than the robot's own", limits_input(),
                  Presence::optional)
          .number("start_speed_m_s", AT(problem.start_speed_m_s), not_negative, "speed at the start", 0,
                  greatest_speed)
          .number("end_speed_m_s", AT(problem.end_speed_m_s), not_negative, "speed at the end", 0,
                  greatest_speed)
          .number("deadline_s", AT(problem.deadline_s), positive,
                  "latest arrival, dwells included; absent: the duration of least cost")
          .number("value_of_time_w", AT(problem.value_of_time_w), value_of_time_bounds_w,
                  "value of time, added to the energy", 0)
          .number("regeneration", AT(problem.regeneration), fraction,
                  "recovered share of braking power; replaces that of the robot file")
          .number("payload_kg", AT(options.payload_kg), not_negative,
                  "at the start; with pickup, carried from there to dropoff", 0, payload_limit<DriveInput>)
          .object("start_pose", AT(options.start), "where the path begins; default: the origin", pose_input(),
                  Presence::optional)
          .include(way_input(), &DriveInput::way)
          .check([](Fields&, DriveInput& drive, PathContext&) {
            if (drive.way.stations) drive.options.payload_kg = 0;
          });
  return input;
}

DriveInput undriven(const robot::RobotModel& robot) {
  DriveInput drive;
  drive.problem.limits = planning::limits_of(robot);
  return drive;
}

const Table<Quantiles>& quantiles_table() {
  static const auto table = Table<Quantiles>("Values at the quantiles 5, 50 and 95 %")
                                .named("quantiles")
                                .number_or_null("p05", AT(at(0)), "5 of 100 are below")
                                .number_or_null("p50", AT(at(1)), "the median")
                                .number_or_null("p95", AT(at(2)), "95 of 100 are below");
  return table;
}

const Table<ModelInForce>& model_table() {
  static const auto table =
      Table<ModelInForce>()
          .value("robot_id", AT(robot.robot_id), "the robot's id, as in its telemetry and its file")
          .value("model_version", &ModelInForce::version,
                 "version of the robot's model that this is computed with");
  return table;
}

const Table<planning::Profile>& columns_table(bool null_positions) {
  static const auto known = make_columns(false), unknown = make_columns(true);
  return null_positions ? unknown : known;
}

}  // namespace joulecast::answers
