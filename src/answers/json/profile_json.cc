#include "answers/json/profile_json.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "answers/json/drive_json.h"
#include "base/try.h"

namespace joulecast::answers {
namespace {

constexpr std::int64_t max_pareto_points = 200;

void write_summary(JsonWriter& json, const planning::Summary& s) {
  json.field("energy_j", s.energy_j)
      .field("duration_s", s.duration_s)
      .field("distance_m", s.distance_m)
      .field("turned_rad", s.turned_rad);
  json.field("peak_speed_m_s", s.peak_speed_m_s)
      .field("peak_yaw_rate_rad_s", s.peak_yaw_rate_rad_s)
      .field("peak_power_w", s.peak_power_w);
  json.field("braking_j", s.braking_j).field("recovered_j", s.recovered_j);
}

void write_certificate(JsonWriter& json, const planning::Certificate& c) {
  json.key("certificate").begin_object();
  json.field("method", planning::name_of(c.method))
      .field("gap_j", c.gap_j)
      .field("discretisation_j", c.discretisation_j);
  json.field("residual", c.residual)
      .field("convex", c.convex)
      .field("time_multiplier_w", c.time_multiplier_w)
      .field("shortest_time_s", c.shortest_time_s);
  json.key("binding").begin_array();
  for (const planning::Bound bound : c.binding) json.value(planning::name_of(bound));
  json.end_array().field("iterations", c.iterations).end_object();
}

void write_baseline(JsonWriter& json, const char* name,
                    const std::optional<ProfileOutput::Baseline>& baseline, bool columns) {
  json.key(name);
  if (!baseline) {
    json.null();
    return;
  }
  const planning::Baseline& motion = baseline->motion;
  json.begin_object().field("energy_j", motion.energy_j).field("duration_s", motion.duration_s);
  json.field("peak_speed_m_s", motion.peak_speed_m_s).field("within_limits", baseline->within_limits);
  json.field("saving_fraction", baseline->saving_fraction);
  if (columns) {
    json.key("profile").begin_object();
    json.column("time_s", motion.time_s).column("speed_m_s", motion.speed_m_s);
    json.column("yaw_rate_rad_s", motion.yaw_rate_rad_s).column("power_w", motion.power_w, 4);
    json.column("energy_j", motion.energy_column_j, 4).end_object();
  }
  json.end_object();
}

}  // namespace

const described::Input<ProfileInput, PathContext>& profile_input() {
  static const auto input =
      described::Input<ProfileInput, PathContext>("A path to drive with the least energy")
          .include(drive_input(), &ProfileInput::drive)
          .number("energy_budget_j",
                  described::within(&ProfileInput::drive, &DriveInput::problem,
                                    &planning::Problem::energy_budget_j),
                  positive,
                  "the fastest motion that takes at most so much energy; without deadline_s and "
                  "value_of_time_w")
          .check([](Fields& fields, ProfileInput& profile, PathContext&) {
            const planning::Problem& problem = profile.drive.problem;
            if (problem.energy_budget_j && (problem.deadline_s || problem.value_of_time_w > 0))
              fields.fault("energy_budget_j", "must be given without deadline_s and value_of_time_w");
          })
          .boolean("columns", &ProfileInput::columns,
                   "false leaves the profile out; a motion of more than 500000 rows is refused", true)
          .boolean("baseline_columns", &ProfileInput::baseline_columns,
                   "true gives the trapezoid's and the triangle's motion over time too", false)
          .integer("pareto_points", &ProfileInput::pareto_points, 0, max_pareto_points,
                   "points of the front of energy against time", 0);
  return input;
}

Result<ProfileInput> read_profile(const nlohmann::json& request, const robot::RobotModel& robot) {
  TRY_ASSIGN(auto input,
             profile_input().read(request, {.drive = undriven(robot)}, {robot.limits.payload_kg}));
  input.drive.problem.rows = input.columns;
  return input;
}

std::string profile_json(const ProfileInput& input, const ProfileOutput& output, const ModelInForce& model) {
  const planning::Plan& plan = output.plan;
  JsonWriter json;
  json.begin_object();
  json.field("robot_id", model.robot.robot_id).field("model_version", model.version);
  write_summary(json, plan.summary);
  write_certificate(json, plan.certificate);
  json.key("ledger_j").begin_object();
  for (std::size_t k = 0; k < signals::term_count; ++k)
    json.field(signals::term_names[k], plan.ledger.value[k]);
  json.end_object();
  json.key("baselines").begin_object();
  write_baseline(json, "trapezoid", output.trapezoid, input.baseline_columns);
  write_baseline(json, "triangle", output.triangle, input.baseline_columns);
  json.end_object();
  json.field("needed_speed_m_s", output.needed_speed_m_s);
  json.key("pareto").begin_array();
  for (const planning::PlanCost& cost : output.pareto) {
    json.begin_object()
        .field("duration_s", cost.duration_s)
        .field("energy_j", cost.energy_j)
        .field("time_multiplier_w", cost.time_multiplier_w)
        .field("peak_speed_m_s", cost.peak_speed_m_s)
        .end_object();
  }
  json.end_array();
  if (input.columns) write_profile_columns(json, plan.profile);
  json.end_object();
  return json.take();
}

Result<std::string> profile_answer(const nlohmann::json& request, const ModelInForce& model) {
  TRY_ASSIGN(const auto input, read_profile(request, model.robot));
  TRY_ASSIGN(const auto output, profile(input, model));
  return profile_json(input, output, model);
}

}  // namespace joulecast::answers
