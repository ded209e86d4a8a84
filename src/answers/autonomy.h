#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "answers/battery_dialects.h"
#include "answers/drive.h"
#include "answers/model.h"
#include "describe/schema.h"
#include "forecast/leg_cost.h"
#include "forecast/outlook.h"
#include "planning/cost_table.h"

namespace joulecast::answers {

using forecast::StatedPace;

// Drives the way, then stands.
struct AutonomyTask {
  std::string task_id;
  std::optional<double> payload_kg;  // absent: as before
  StatedPace pace;
  Way way;
  std::optional<double> dwell_s;
  std::optional<double> to_charger_m;  // from where the task ends
};

struct Charger {
  planning::Point at;
  double detour_factor = 1;  // of the way to it over the straight line
};

struct AutonomyInput {
  std::optional<double> state_of_charge;     // instead of the live one
  std::optional<double> state_of_charge_sd;  // of state_of_charge
  std::optional<double> reserve_fraction;    // instead of the robot file's
  std::optional<double> payload_kg;          // instead of the live one
  Driving driving = Driving::usual;
  bool compare_minimum_energy = false;
  bool compare_fastest = false;  // with the fastest driving that keeps the reserve
  double value_of_time_w = 0;    // of the planner's profiles
  StatedPace pace;
  double confidence = 0.95;
  std::optional<planning::Pose> start_pose;  // instead of the live one, else the origin
  std::optional<Charger> charger;
  std::optional<double> to_charger_m;  // from where the robot is, instead of the charger's place
  std::vector<AutonomyTask> tasks;     // each begins where the one before ends
};

// The planned legs, from stop to stop.
struct TaskPlan {
  struct Task {
    std::vector<forecast::PlannedLeg> legs;
    std::vector<forecast::PlannedLeg> to_charger;  // empty: no charger given
    double greatest_payload_kg = 0;
  };
  std::vector<Task> tasks;
  std::vector<forecast::PlannedLeg> from_here;  // to the charger
  bool halts_stated = false;  // a task states its dwell, possibly 0: no other halts are predicted
};

// Builds each task's path once. Errors name "/tasks/<index>/path/...".
Result<TaskPlan> task_plan(const AutonomyInput& input, const LiveRobot& now);

// The planner's profiles at the greatest value of time with which a plan ends with the reserve.
struct FastestDriving {
  double value_of_time_w = 0;
  forecast::Outlook outlook;
};

struct AutonomyOutput {
  forecast::Charge charge;
  bool charge_is_live = false;
  double payload_kg = 0;
  forecast::Driving track = forecast::Driving::usual;  // of the forecast
  forecast::Pace pace;
  std::optional<forecast::Limitation> limitation;  // the motors do not reach the pace
  forecast::Reach reach;
  std::optional<forecast::Outlook> outlook;                 // with a task list or a charger
  std::optional<forecast::Outlook> minimum_energy_outlook;  // the same, driven as the planner would
  // Keeps the reserve with the requested confidence; absent: not requested, or no driving does.
  std::optional<FastestDriving> fastest;
};

// The remaining range and run time of a robot, and the outlook of the plan. infeasible when the charge is
// unknown; invalid for a payload beyond the robot's limit; unavailable once the token is set.
Result<AutonomyOutput> autonomy(const AutonomyInput& input, const TaskPlan& plan, const RobotOutlook& robot,
                                const LiveRobot& now, planning::CostTableCache& tables,
                                const std::stop_token& stop = {});

// The given charge, else the live one. infeasible where neither is available.
Result<forecast::Charge> charge_of(const std::optional<double>& given, const std::optional<double>& given_sd,
                                   const std::optional<double>& reserve, const robot::Battery& battery,
                                   const LiveRobot& now);

struct AutonomyRequest {
  AutonomyInput input;
  Dialect dialect = Dialect::joulecast;

  bool former() const;  // members of the version before are used
};

// "autonomy-request", "autonomy" and those to which they refer.
described::Schemas autonomy_schemas();
// `single`: the request is for one robot, so that the comparison with minimum-energy profiles is made unless
// it is declined. Errors name the field, with the JSON pointer `at` of the request in front.
Result<AutonomyRequest> read_autonomy(const nlohmann::json& body, bool single, const std::string& at = {});

// In the dialect of the request.
std::string autonomy_json(const AutonomyRequest& request, const AutonomyOutput& output,
                          const RobotOutlook& robot, const LiveRobot& now);

// From request to answer, of one robot.
Result<std::string> autonomy_text(const AutonomyRequest& request, const RobotOutlook& robot,
                                  const LiveRobot& now, planning::CostTableCache& tables,
                                  const std::stop_token& stop = {});
Result<std::string> autonomy_answer(const nlohmann::json& request, const RobotOutlook& robot,
                                    const LiveRobot& now, planning::CostTableCache& tables);

}  // namespace joulecast::answers
