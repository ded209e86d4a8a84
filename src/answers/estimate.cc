#include "answers/estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "answers/mission.h"
#include "answers/profile.h"
#include "base/try.h"
#include "forecast/outlook.h"
#include "planning/numerics.h"

namespace joulecast::answers {
namespace {

// A given motion as columns: power at its points and in between, energy by Gauss's rule over each span. Its
// peaks are stored in `peaks`.
planning::Profile series_of(const dynamics::DriveModel& drive, const GivenMotion& motion,
                            planning::Peaks& peaks) {
  const auto& [points, payload_kg, start] = motion;
  constexpr int cuts = 4;  // of a span, so that power's bow shows
  planning::Profile p;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  planning::Pose pose =
      start ? planning::Pose{start->x_m, start->y_m, start->heading_rad} : planning::Pose{nan, nan, nan};
  double distance = 0, energy = 0;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const energy::MotionPoint &a = points[k], &b = points[k + 1];
    const double span = b.time_s - a.time_s;
    if (span == 0) continue;
    const double slope = (b.speed_m_s - a.speed_m_s) / span,
                 bend = (b.yaw_rate_rad_s - a.yaw_rate_rad_s) / span;
    const std::array<double, 2> climb = *energy::climb_of_span(a, b);  // estimate_motion() accepted it
    const bool in_place = a.speed_m_s == 0 && b.speed_m_s == 0;
    planning::Peaks here;
    here.peak_speed_m_s = std::max(std::fabs(a.speed_m_s), std::fabs(b.speed_m_s));
    here.peak_yaw_rate_rad_s = std::max(std::fabs(a.yaw_rate_rad_s), std::fabs(b.yaw_rate_rad_s));
    here.peak_acceleration_m_s2 = std::fabs(in_place ? drive.parameters().half_track_m * bend : slope);
    peaks.reach(here);
    const auto power = [&, payload = payload_kg](double t) {
      dynamics::Instant at;
      at.wheel_speed_rad_s =
          dynamics::wheels_of_body(drive.parameters(), a.speed_m_s + slope * t, a.yaw_rate_rad_s + bend * t);
      at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(drive.parameters(), slope, bend);
      at.payload_kg = payload;
      at.x_m = pose.x_m, at.y_m = pose.y_m, at.heading_rad = pose.heading_rad;
      at.climb_rad = climb[0] + (climb[1] - climb[0]) * t / span;
      const auto flow = drive.flow(at);
      peaks.reach(at.wheel_speed_rad_s, flow);
      return flow.battery_power_w;
    };
    for (int cut = 0; cut <= cuts; ++cut) {
      const double t = span * cut / cuts, h = span / cuts;
      const double v = a.speed_m_s + slope * t, yaw = a.yaw_rate_rad_s + bend * t;
      p.time_s.push_back(a.time_s + t);
      p.distance_m.push_back(distance);
      p.x_m.push_back(pose.x_m), p.y_m.push_back(pose.y_m), p.heading_rad.push_back(pose.heading_rad);
      p.speed_m_s.push_back(v), p.yaw_rate_rad_s.push_back(yaw);
      p.acceleration_m_s2.push_back(slope), p.yaw_acceleration_rad_s2.push_back(bend);
      p.payload_kg.push_back(payload_kg);
      p.power_w.push_back(power(t));
      p.energy_j.push_back(energy);
      if (cut == cuts) break;
      for (const auto& [node, weight] : planning::gauss3) energy += weight * h * power(t + node * h);
      const double way = (v + 0.5 * slope * h) * h, turned = (yaw + 0.5 * bend * h) * h;
      const double heading = pose.heading_rad + 0.5 * turned;
      pose.x_m += way * std::cos(heading), pose.y_m += way * std::sin(heading);
      pose.heading_rad += turned;
      distance += std::fabs(way);
    }
  }
  return p;
}

Result<EstimateOutput> of_motion(const GivenMotion& motion, bool columns, const ModelInForce& model) {
  auto priced = energy::estimate_motion(model.drive, motion.points, motion.payload_kg, motion.start);
  if (!priced) {
    priced.error().field.insert(0, "/profile/");
    return tl::unexpected(std::move(priced.error()));
  }
  EstimateOutput out;
  out.accounts = *priced;
  planning::Peaks peaks;
  planning::Profile series = series_of(model.drive, motion, peaks);
  out.beyond_limits = peaks.beyond(planning::limits_of(model.robot));
  if (columns) out.columns = std::move(series);
  return out;
}

Result<EstimateOutput> of_optimum(DriveInput drive, bool columns, const ModelInForce& model,
                                  const std::stop_token& stop) {
  drive.problem.rows = columns;
  TRY_ASSIGN(auto best, plan(drive, model, stop));
  EstimateOutput out;
  out.accounts.battery_j = best.summary.energy_j;
  out.accounts.ledger = best.ledger;
  out.accounts.duration_s = best.summary.duration_s;
  out.accounts.distance_m = best.summary.distance_m;
  out.accounts.turned_rad = best.summary.turned_rad;
  if (columns) out.columns = std::move(best.profile);
  return out;
}

Result<EstimateOutput> of_habit(const DriveInput& drive, const RobotOutlook& robot) {
  TRY_ASSIGN(const auto path, path_of(drive.way, drive.options));
  const forecast::Forecaster& forecaster = *robot.forecaster;
  const forecast::LegPricer pricer(robot.model->robot, robot.model->drive);
  const auto legs = planned_legs(path);
  const auto priced =
      forecast::price(forecaster, pricer, legs, {}, drive.way.halts_stated() || forecast::states_halts(legs));
  if (const auto stuck = forecast::obstacle(pricer, legs, priced)) return tl::unexpected(*stuck);
  const forecast::PlanSum sum = forecast::sum_of(forecaster, priced);
  const forecast::Prediction energy = forecaster.energy(sum);
  EstimateOutput out;
  out.siblings_pending = robot.siblings_pending;
  out.accounts.battery_j = energy.expected();
  out.accounts.duration_s = forecaster.duration(sum).quantile(0.5);
  out.accounts.distance_m = path.distance_m();
  out.accounts.turned_rad = path.turned_rad();
  auto& quantiles = out.energy_quantiles_j.emplace();
  std::ranges::transform(forecast::stated_quantiles, quantiles.begin(),
                         [&](double q) { return energy.quantile(q); });
  return out;
}

using Json = nlohmann::json;

using described::Input;
using described::Presence;
using described::Table;

// A motion over time.
struct MotionColumns {
  std::vector<double> time_s, speed_m_s;
  std::optional<std::vector<double>> yaw_rate_rad_s, climb_rad, height_m;
};

// Faults a column of another length than that of the times.
void check_length(Fields& fields, const char* name, std::size_t times, std::size_t column) {
  if (fields.ok() && column != times) fields.fault(name, "must have as many entries as time_s");
}
void check_length(Fields& fields, const char* name, std::size_t times,
                  const std::optional<std::vector<double>>& column) {
  if (column) check_length(fields, name, times, column->size());
}

constexpr described::Count points_of_motion{2, 200'000};
constexpr Bounds motion_speed{.minimum = -100, .maximum = 100};

const auto columns_input =
    Input<MotionColumns>({}, "speeds are linear in between")
        .numbers("time_s", AT(time_s), points_of_motion, {.minimum = 0, .maximum = 1e7},
                 "times, ascending; repeated where only the acceleration or the climb steps")
        .numbers("speed_m_s", AT(speed_m_s), points_of_motion, motion_speed,
                 "forward speed; negative: backwards")
        .numbers("yaw_rate_rad_s", AT(yaw_rate_rad_s), points_of_motion, motion_speed,
                 "rate of turning, positive to the left")
        .check([](Fields& fields, MotionColumns& columns, described::Nothing&) {
          check_length(fields, "speed_m_s", columns.time_s.size(), columns.speed_m_s.size());
          check_length(fields, "yaw_rate_rad_s", columns.time_s.size(), columns.yaw_rate_rad_s);
        })
        .numbers("climb_rad", AT(climb_rad), points_of_motion, {.minimum = -0.785, .maximum = 0.785},
                 "angle of the floor along the heading, nose up positive, linear in between; used if the "
                 "robot's effects contain grade")
        .numbers("height_m", AT(height_m), points_of_motion, {.minimum = -1e5, .maximum = 1e5},
                 "height above any fixed datum, linear between two points; replaces climb_rad")
        .check([](Fields& fields, MotionColumns& columns, described::Nothing&) {
          if (columns.climb_rad && columns.height_m)
            fields.fault("climb_rad", "must not be combined with height_m, from which it follows");
          check_length(fields, "climb_rad", columns.time_s.size(), columns.climb_rad);
          check_length(fields, "height_m", columns.time_s.size(), columns.height_m);
        });

std::vector<energy::MotionPoint> points_of(const MotionColumns& columns) {
  std::vector<energy::MotionPoint> points;
  points.reserve(columns.time_s.size());
  const auto at = [](const std::optional<std::vector<double>>& column, std::size_t k, double absent) {
    return column ? (*column)[k] : absent;
  };
  for (std::size_t k = 0; k < columns.time_s.size(); ++k)
    points.push_back({columns.time_s[k], columns.speed_m_s[k], at(columns.yaw_rate_rad_s, k, 0),
                      at(columns.climb_rad, k, dynamics::unknown),
                      at(columns.height_m, k, dynamics::unknown)});
  return points;
}

GivenMotion& given_motion(EstimateInput& input) {
  if (!std::holds_alternative<GivenMotion>(input.motion)) input.motion.emplace<GivenMotion>();
  return std::get<GivenMotion>(input.motion);
}

// Rejects members that apply only to a planned motion.
void check_usual(Fields& fields, const EstimateInput& input, PathContext&) {
  if (input.driving != Driving::usual) return;
  if (input.columns)
    fields.fault("columns", "must be false beside \"driving\": \"usual\", which is not planned");
  refuse_beside_usual(fields, {"deadline_s", "value_of_time_w", "start_speed_m_s", "end_speed_m_s",
                               "regeneration", "limits"});
}

struct EstimateAnswer {
  const EstimateInput& input;
  const EstimateOutput& output;
  const ModelInForce& model;
};

const auto broken_limit_table =
    Table<planning::BrokenLimit>()
        .word("limit", AT(limit),
              std::array{"speed", "acceleration", "yaw_rate", "wheel_speed", "current", "voltage"},
              "the exceeded limit")
        .value("reached", AT(reached),
               "greatest value of the motion, in the limit's unit: m/s, m/s^2, rad/s, rad/s, A, V")
        .value("allowed", AT(allowed), "the limit");
const auto estimate_table =
    Table<EstimateAnswer>("Energy and ledger of a motion")
        .include(model_table(), AT(model))
        .word(
            "driving",
            [](const EstimateAnswer& a) -> std::string_view {
              return std::holds_alternative<GivenMotion>(a.input.motion) ? "given" : name_of(a.input.driving);
            },
            std::array{"minimum_energy", "usual", "given"}, "given: the motion of the request")
        .value("energy_j", AT(output.accounts.battery_j),
               "from the battery; of usual driving the mean, the sum over the legs")
        .value("duration_s", AT(output.accounts.duration_s), "from start to end")
        .value("distance_m", AT(output.accounts.distance_m),
               "driven distance, forward and backward both positive")
        .value("turned_rad", AT(output.accounts.turned_rad), "turned angle, both senses positive")
        .object("energy_quantiles_j", AT(output.energy_quantiles_j),
                "of usual driving, the forecast of energy_j; else null", quantiles_table())
        .value("siblings_pending", [](const EstimateAnswer&) { return true; },
               "of usual driving while a started daemon still reads missions of its siblings: the forecast "
               "will improve",
               {{"const", true}})
        .only(AT(output.siblings_pending))
        .list("beyond_limits", AT(output.beyond_limits),
              "limits of the robot that the given motion exceeds: speeds by more than 1e-6 of the limit; "
              "acceleration, current and voltage, which are computed from the slope of rounded speeds, by "
              "more than 0.0015 of it, current and voltage only while a wheel turns at 0.05 rad/s or faster. "
              "Empty for a path: its plan satisfies the limits",
              broken_limit_table)
        .object(
            "ledger",
            [](const EstimateAnswer& a) {
              return a.output.energy_quantiles_j ? nullptr : &a.output.accounts;
            },
            "null for usual driving: its forecast has no terms", ledger_table())
        .object(
            "profile", [](const EstimateAnswer& a) -> const auto& { return *a.output.columns; },
            "the motion over time, if columns are requested; positions are null without start_pose",
            columns_table(true))
        .only(AT(output.columns.has_value()));

}  // namespace

Result<EstimateOutput> estimate(const EstimateInput& input, const RobotOutlook& robot,
                                const std::stop_token& stop) {
  if (const auto* motion = std::get_if<GivenMotion>(&input.motion))
    return of_motion(*motion, input.columns, *robot.model);
  const auto& drive = std::get<DriveInput>(input.motion);
  if (input.driving == Driving::usual) return of_habit(drive, robot);
  return of_optimum(drive, input.columns, *robot.model, stop);
}

const auto given_input =
    Input<EstimateInput, PathContext>()
        .object(
            "profile",
            [](EstimateInput& input, const MotionColumns& columns) {
              given_motion(input).points = points_of(columns);
            },
            {}, columns_input)
        .number(
            "payload_kg", [](EstimateInput& input) -> double& { return given_motion(input).payload_kg; },
            not_negative, "at the start", 0, payload_limit<EstimateInput>)
        .object(
            "start_pose",
            [](EstimateInput& input, const planning::Pose& pose) {
              given_motion(input).start = {pose.x_m, pose.y_m, pose.heading_rad};
            },
            "start of the motion; default for a path: the origin", pose_input(), Presence::optional);
const auto planned_input =
    Input<EstimateInput, PathContext>()
        .choice("driving", &EstimateInput::driving, driving_names,
                "driving model of a path. minimum_energy: its minimum-energy motion, as returned by the "
                "profile operation and independent of the robot's history; usual: the robot's own pace and "
                "the consumption estimated from its missions, for robots that do not drive the planner's "
                "profile. deadline_s, value_of_time_w, end speeds, limits, regeneration and columns are "
                "valid only with minimum_energy",
                static_cast<std::size_t>(Driving::minimum_energy))
        .include(drive_input(),
                 [](EstimateInput& input) -> DriveInput& { return std::get<DriveInput>(input.motion); })
        .check(check_usual);
const auto estimate_input =
    Input<EstimateInput, PathContext>("A motion to estimate: a profile, or a path")
        .boolean("columns", &EstimateInput::columns, "true gives the motion over time", false)
        .either(given_input, planned_input);

Result<EstimateInput> read_estimate(const Json& request, const robot::RobotModel& robot) {
  return estimate_input.read(request, {.motion = undriven(robot)}, {robot.limits.payload_kg});
}

described::Schemas estimate_schemas() {
  return {{"estimate-request", estimate_input.schema()}, {"estimate", estimate_table.schema()}};
}

std::string estimate_json(const EstimateInput& input, const EstimateOutput& output,
                          const ModelInForce& model) {
  return estimate_table.text({input, output, model});
}

Result<std::string> estimate_answer(const Json& request, const RobotOutlook& robot) {
  TRY_ASSIGN(const auto input, read_estimate(request, robot.model->robot));
  TRY_ASSIGN(const auto output, estimate(input, robot));
  return estimate_json(input, output, *robot.model);
}

}  // namespace joulecast::answers
