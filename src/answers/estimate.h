#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <variant>
#include <vector>

#include "answers/drive.h"
#include "answers/model.h"
#include "energy/motion_estimate.h"
#include "planning/load.h"

namespace joulecast::answers {

// A motion as it is to be driven.
struct GivenMotion {
  std::vector<energy::MotionPoint> points;
  double payload_kg = 0;
  std::optional<energy::StartPose> start;
};

struct EstimateInput {
  std::variant<DriveInput, GivenMotion> motion;
  Driving driving = Driving::minimum_energy;  // of a path
  bool columns = false;                       // not of usual driving, which is not planned
};

struct EstimateOutput {
  // Of usual driving without a ledger; its energy is an expectation.
  signals::Accounts accounts;
  std::optional<std::array<double, 3>> energy_quantiles_j;  // of usual driving, at forecast::stated_quantiles
  std::vector<planning::BrokenLimit> beyond_limits;         // by a given motion
  std::optional<planning::Profile> columns;                 // where requested
  bool siblings_pending = false;                            // of usual driving, as in RobotOutlook
};

// Energy of a motion: of a given one by CVODE, of a path's minimum-energy motion by the planner, of usual
// driving by the robot's forecast. Errors name "/path/...", "/profile/..." or the field of the problem.
// A stop ends planning with Fault::stopped.
Result<EstimateOutput> estimate(const EstimateInput& input, const RobotOutlook& robot,
                                const std::stop_token& stop = {});

described::Schemas estimate_schemas();
// Errors name the field.
Result<EstimateInput> read_estimate(const nlohmann::json& request, const robot::RobotModel& robot);
std::string estimate_json(const EstimateInput& input, const EstimateOutput& output,
                          const ModelInForce& model);

Result<std::string> estimate_answer(const nlohmann::json& request, const RobotOutlook& robot);

}  // namespace joulecast::answers
