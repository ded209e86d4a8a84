#include "answers/profile.h"

#include <utility>

#include "base/try.h"

namespace joulecast::answers {
namespace {

std::optional<ProfileOutput::Baseline> baseline(const planning::Planner& planner, const ProfileInput& input,
                                                const planning::Path& path, const planning::Plan& plan,
                                                double ramp_fraction) {
  const planning::Problem& problem = input.drive.problem;
  auto motion = planning::ramp_baseline(planner.loads(), path, plan.run_duration_s, problem.start_speed_m_s,
                                        problem.end_speed_m_s, ramp_fraction, input.baseline_columns);
  if (!motion) return std::nullopt;
  const bool within = motion->beyond(problem.limits).empty();
  const double saving = 1 - plan.summary.energy_j / motion->energy_j;
  return ProfileOutput::Baseline{std::move(*motion), within, saving};
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

}  // namespace

Result<planning::Plan> plan(const DriveInput& input, const ModelInForce& model, const std::stop_token& stop) {
  TRY_ASSIGN(const auto path, path_of(input.way, input.options));
  std::optional<planning::Planner> own;
  TRY_ASSIGN(const auto planner, planner_for(input, model, own));
  return planner->plan(path, input.problem, stop);
}

Result<ProfileOutput> profile(const ProfileInput& input, const ModelInForce& model,
                              const std::stop_token& stop) {
  TRY_ASSIGN(const auto path, path_of(input.drive.way, input.drive.options));
  std::optional<planning::Planner> own;
  TRY_ASSIGN(const auto planner, planner_for(input.drive, model, own));
  TRY_ASSIGN(auto plan, planner->plan(path, input.drive.problem, stop));
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

}  // namespace joulecast::answers
