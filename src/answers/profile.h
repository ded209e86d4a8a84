#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "answers/drive.h"
#include "answers/model.h"
#include "planning/baseline.h"

namespace joulecast::answers {

// A plan with less than this relative excess over the shortest time counts as fastest: ten times the
// planner's tolerance of deadlines.
inline constexpr double at_the_limit = 1e-3;

struct ProfileInput {
  DriveInput drive;
  bool columns = true;            // the answer contains the profile
  bool baseline_columns = false;  // and those of the baselines
  std::size_t pareto_points = 0;  // of the front of energy against time; fewer than 2: none
};

struct ProfileOutput {
  struct Baseline {
    planning::Baseline motion;
    bool within_limits = true;
    double saving_fraction = 0;  // of its energy, by the plan
    std::optional<planning::Baseline> slowed;
  };
  planning::Plan plan;
  std::optional<Baseline> trapezoid, triangle;  // as long on every run; absent where a run is too short
  std::optional<double> needed_speed_m_s;       // with a deadline
  std::vector<planning::PlanCost> pareto;
};

// The minimum-energy motion along the path within the limits, against a trapezoid and a triangle. A stop ends
// planning with Fault::stopped.
Result<ProfileOutput> profile(const ProfileInput& input, const ModelInForce& model,
                              const std::stop_token& stop = {});

// The same where it takes no more than some tens of microseconds; empty for longer ones and for errors.
std::optional<ProfileOutput> profile_at_once(const ProfileInput& input, const ModelInForce& model);

// The same without the comparisons. With another regeneration than the model's a planner is made.
Result<planning::Plan> plan(const DriveInput& input, const ModelInForce& model,
                            const std::stop_token& stop = {});

described::Schemas profile_schemas();
// Errors name the field.
Result<ProfileInput> read_profile(const nlohmann::json& request, const robot::RobotModel& robot);
std::string profile_json(const ProfileInput& input, const ProfileOutput& output, const ModelInForce& model);

Result<std::string> profile_answer(const nlohmann::json& request, const ModelInForce& model);

}  // namespace joulecast::answers
