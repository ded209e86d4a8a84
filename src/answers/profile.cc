#include "answers/profile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ranges>
#include <utility>

#include "answers/mission.h"
#include "base/try.h"

namespace joulecast::answers {
namespace {

// Whether the baseline keeps the limits; otherwise, if columns are requested, the same motion in the least of
// some multiples of its time with which it does.
std::optional<ProfileOutput::Baseline> baseline(const planning::Planner& planner, const ProfileInput& input,
                                                const planning::Path& path, const planning::Plan& plan,
                                                double ramp_fraction) {
  const planning::Problem& problem = input.drive.problem;
  const planning::Limits& limits = problem.limits;
  const auto driven = [&](double multiple, bool columns) {
    auto durations = plan.run_duration_s;
    for (double& duration_s : durations) duration_s *= multiple;
    return planning::ramp_baseline(planner.loads(), path, durations, problem.start_speed_m_s,
                                   problem.end_speed_m_s, ramp_fraction, columns);
  };
  auto motion = driven(1, input.baseline_columns);
  if (!motion) return std::nullopt;
  ProfileOutput::Baseline baseline;
  baseline.within_limits = motion->beyond(limits).empty();
  baseline.saving_fraction = 1 - plan.summary.energy_j / motion->energy_j;
  const double least = std::max({1.0, motion->peak_speed_m_s / limits.speed_m_s,
                                 motion->peak_yaw_rate_rad_s / limits.yaw_rate_rad_s,
                                 std::sqrt(motion->peak_acceleration_m_s2 / limits.acceleration_m_s2)});
  for (const double more : {1.001, 1.03, 1.07, 1.15, 1.3, 1.5, 2.0}) {
    if (baseline.within_limits || baseline.slowed || !input.baseline_columns) break;
    const auto slower = driven(least * more, false);
    if (slower && slower->beyond(limits).empty()) baseline.slowed = *slower;
  }
  baseline.motion = std::move(*motion);
  return baseline;
}

Result<ProfileOutput> compared(const planning::Planner& planner, const ProfileInput& input,
                               const planning::Path& path, planning::Plan plan, const std::stop_token& stop) {
  const planning::Problem& problem = input.drive.problem;
  ProfileOutput out;
  out.trapezoid = baseline(planner, input, path, plan, 1.0 / 3);
  out.triangle = baseline(planner, input, path, plan, 0.5);
  out.plan = std::move(plan);
  if (problem.deadline_s) {
    TRY_ASSIGN(out.needed_speed_m_s, planner.needed_speed(path, problem, stop));
  }
  if (input.pareto_points >= 2) {
    TRY_ASSIGN(out.pareto, planner.pareto(path, problem, input.pareto_points, stop));
  }
  return out;
}

// The model's planner, or one of its own for another regeneration.
Result<const planning::Planner*> planner_for(const DriveInput& input, const ModelInForce& model,
                                             std::optional<planning::Planner>& own) {
  if (!input.problem.regeneration) return &model.planner;
  TRY_ASSIGN(auto made, planning::Planner::make(model.robot, input.problem.regeneration));
  return &own.emplace(std::move(made));
}

// Errors of the way name the member that gives it.
Result<planning::Plan> planned(const planning::Planner& planner, const DriveInput& input,
                               const planning::Path& path, const std::stop_token& stop) {
  auto plan = planner.plan(path, input.problem, stop);
  if (!plan && plan.error().field == "path") plan.error().field = input.way.member;
  return plan;
}

constexpr std::int64_t max_pareto_points = 200;

using described::Table;
using planning::Baseline;
using planning::Certificate;
using planning::Method;
using planning::PlanCost;

constexpr const char* drawn_words = "energy drawn from the battery";

const std::array method_names{name_of(Method::closed_form), name_of(Method::quadrature),
                              name_of(Method::interior_point), name_of(Method::mixed)};
const auto bound_names = [] {
  std::array<std::string_view, planning::bound_count> names;
  for (std::size_t k = 0; k < names.size(); ++k) names[k] = name_of(static_cast<planning::Bound>(k));
  return names;
}();

const auto certificate_table =
    Table<Certificate>()
        .word("method", AT(method), method_names, "how it was solved")
        .value("gap_j", AT(gap_j),
               "energy plus value of time, minus gap_j, is a lower bound of the optimum where the problem "
               "is convex")
        .value("discretisation_j", AT(discretisation_j),
               "estimated excess over the optimum due to constant acceleration between rows, in addition "
               "to gap_j")
        .value("residual", AT(residual), "residual of the optimality conditions, 0 at the optimum")
        .value("convex", AT(convex),
               "whether the problem is convex, so that the optimum is global. Otherwise gap_j compares "
               "with motions near this one only, and no bound on the least energy of all motions is given")
        .number_or_null(
            "time_multiplier_w", AT(time_multiplier_w),
            "energy cost of shortening the duration, J per second; 0: no other duration needs less energy; "
            "null: none is shorter. The shortest feasible duration is shortest_time_s")
        .number_or_null("shortest_time_s", AT(shortest_time_s),
                        "shortest duration within the limits, relative accuracy 1e-4; every later deadline "
                        "is met; null: no limit bounds the duration")
        .words_of(
            "binding",
            [](const Certificate& c) {
              return c.binding | std::views::transform([](auto bound) { return name_of(bound); });
            },
            bound_names, "binding limits, which cost time or energy")
        .value("iterations", AT(iterations), "of the interior point method, in all searches");

struct BaselineAnswer {
  const ProfileOutput::Baseline& baseline;
  bool columns;
};

struct ProfileAnswer {
  const ProfileInput& input;
  const ProfileOutput& output;
  const ModelInForce& model;
};

const auto baseline_motion_table =
    Table<Baseline>()
        .column("time_s", AT(time_s), "time since the start")
        .column("speed_m_s", AT(speed_m_s), "forward speed; negative: backwards")
        .column("yaw_rate_rad_s", AT(yaw_rate_rad_s), "rate of turning, positive to the left")
        .all_digits("power_w", AT(power_w), "power drawn from the battery", false)
        .all_digits("energy_j", AT(energy_column_j), "drawn from the battery up to here", false);
const auto slowed_table = Table<Baseline>()
                              .value("energy_j", AT(energy_j), drawn_words)
                              .value("duration_s", AT(duration_s), "from start to end");
const auto baseline_table =
    Table<BaselineAnswer>()
        .value("energy_j", AT(baseline.motion.energy_j), drawn_words)
        .value("duration_s", AT(baseline.motion.duration_s), "from start to end")
        .value("peak_speed_m_s", AT(baseline.motion.peak_speed_m_s), "greatest speed")
        .value("within_limits", AT(baseline.within_limits), "whether the robot can drive it")
        .value("saving_fraction", AT(baseline.saving_fraction),
               "relative energy saving of the optimum compared with it")
        .object("profile", AT(baseline.motion), "its motion over time, if baseline_columns is requested",
                baseline_motion_table)
        .only(AT(columns))
        .object(
            "slowed", AT(baseline.slowed),
            "if baseline_columns is requested and it exceeds the limits: the same motion in a longer time "
            "in which it keeps them; null: none",
            slowed_table)
        .only(AT(columns));
const auto shape = [](std::optional<ProfileOutput::Baseline> ProfileOutput::*member) {
  return [member](const ProfileAnswer& a) -> std::optional<BaselineAnswer> {
    if (!(a.output.*member)) return std::nullopt;
    return BaselineAnswer{*(a.output.*member), a.input.baseline_columns};
  };
};
const auto baselines_table =
    Table<ProfileAnswer>()
        .object(
            "trapezoid", shape(&ProfileOutput::trapezoid),
            "constant acceleration, constant speed, constant deceleration; null: not possible on the path",
            baseline_table)
        .object("triangle", shape(&ProfileOutput::triangle),
                "constant acceleration, then constant deceleration; null: not possible on the path",
                baseline_table);

const auto pareto_table = Table<PlanCost>()
                              .value("duration_s", AT(duration_s), "duration of this compromise")
                              .value("energy_j", AT(energy_j), drawn_words)
                              .value("time_multiplier_w", AT(time_multiplier_w),
                                     "energy cost of shortening the duration, J per second")
                              .value("peak_speed_m_s", AT(peak_speed_m_s), "greatest speed");
const auto profile_table =
    Table<ProfileAnswer>("A minimum-energy motion")
        .include(model_table(), AT(model))
        .value("energy_j", AT(output.plan.summary.energy_j), drawn_words)
        .value("duration_s", AT(output.plan.summary.duration_s), "from start to end")
        .value("distance_m", AT(output.plan.summary.distance_m),
               "driven distance, forward and backward both positive")
        .value("turned_rad", AT(output.plan.summary.turned_rad), "turned angle, both senses positive")
        .value("peak_speed_m_s", AT(output.plan.summary.peak_speed_m_s), "greatest speed")
        .value("peak_yaw_rate_rad_s", AT(output.plan.summary.peak_yaw_rate_rad_s), "greatest rate of turning")
        .value("peak_power_w", AT(output.plan.summary.peak_power_w), "greatest power from the battery")
        .value("braking_j", AT(output.plan.summary.braking_j), "energy that braking turns to heat or returns")
        .value("recovered_j", AT(output.plan.summary.recovered_j), "of braking_j, returned to the battery")
        .object("certificate", AT(output.plan.certificate), "proof of its distance from the optimum",
                certificate_table)
        .object("ledger_j", AT(output.plan.ledger), "energy by term", terms_table())
        .object("baselines", std::identity(),
                "profiles of the same duration on every run between stops; null: no such profile exists",
                baselines_table)
        .value("needed_speed_m_s", AT(output.needed_speed_m_s),
               "lowest speed limit with which the deadline can be met; null without a deadline")
        .list("pareto", AT(output.pareto),
              "other compromises between time and energy, in the requested number", pareto_table)
        .object("profile", AT(output.plan.profile), "the motion over time, if columns are requested",
                columns_table(false))
        .only(AT(input.columns));

}  // namespace

Result<planning::Plan> plan(const DriveInput& input, const ModelInForce& model, const std::stop_token& stop) {
  TRY_ASSIGN(const auto path, path_of(input.way, input.options));
  std::optional<planning::Planner> own;
  TRY_ASSIGN(const auto planner, planner_for(input, model, own));
  return planned(*planner, input, path, stop);
}

Result<ProfileOutput> profile(const ProfileInput& input, const ModelInForce& model,
                              const std::stop_token& stop) {
  TRY_ASSIGN(const auto path, path_of(input.drive.way, input.drive.options));
  std::optional<planning::Planner> own;
  TRY_ASSIGN(const auto planner, planner_for(input.drive, model, own));
  TRY_ASSIGN(auto plan, planned(*planner, input.drive, path, stop));
  return compared(*planner, input, path, std::move(plan), stop);
}

std::optional<ProfileOutput> profile_at_once(const ProfileInput& input, const ModelInForce& model) {
  if (!is_brief(input.drive.way.path) || input.pareto_points > 0 || input.drive.problem.regeneration)
    return std::nullopt;
  const auto path = path_of(input.drive.way, input.drive.options);
  if (!path) return std::nullopt;
  auto plan = model.planner.plan_at_once(*path, input.drive.problem);
  if (!plan) return std::nullopt;
  auto out = compared(model.planner, input, *path, std::move(*plan), {});
  return out ? std::optional(std::move(*out)) : std::nullopt;
}

const auto profile_input =
    described::Input<ProfileInput, PathContext>("A way to drive with the least energy")
        .include(drive_input(), &ProfileInput::drive)
        .number(
            "energy_budget_j", AT(drive.problem.energy_budget_j), positive,
            "the fastest motion that takes at most so much energy; without deadline_s and value_of_time_w")
        .check([](Fields& fields, ProfileInput& profile, PathContext&) {
          const planning::Problem& problem = profile.drive.problem;
          if (problem.energy_budget_j && (problem.deadline_s || problem.value_of_time_w > 0))
            fields.fault("energy_budget_j", "must be given without deadline_s and value_of_time_w");
        })
        .boolean("columns", &ProfileInput::columns,
                 "false leaves the profile out; a motion of more than 500000 rows is refused", true)
        .boolean("baseline_columns", &ProfileInput::baseline_columns,
                 "true gives the trapezoid's and the triangle's motion over time too, and how they are "
                 "slowed to the limits",
                 false)
        .integer("pareto_points", &ProfileInput::pareto_points, 0, max_pareto_points,
                 "points of the front of energy against time", 0);

Result<ProfileInput> read_profile(const nlohmann::json& request, const robot::RobotModel& robot) {
  TRY_ASSIGN(auto input, profile_input.read(request, {.drive = undriven(robot)}, {robot.limits.payload_kg}));
  input.drive.problem.rows = input.columns;
  return input;
}

described::Schemas profile_schemas() {
  described::Schema request = profile_input.schema();
  for (const std::string_view name : way_members) request["anyOf"].push_back({{"required", {name}}});
  return {{"profile-request", std::move(request)}, {"profile", profile_table.schema()}};
}

std::string profile_json(const ProfileInput& input, const ProfileOutput& output, const ModelInForce& model) {
  return profile_table.text({input, output, model});
}

Result<std::string> profile_answer(const nlohmann::json& request, const ModelInForce& model) {
  TRY_ASSIGN(const auto input, read_profile(request, model.robot));
  TRY_ASSIGN(const auto output, profile(input, model));
  return profile_json(input, output, model);
}

}  // namespace joulecast::answers
