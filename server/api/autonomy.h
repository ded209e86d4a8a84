#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "base/error.h"
#include "forecast/limitation.h"
#include "forecast/outlook.h"
#include "planning/cost_table_cache.h"
#include "server/api/autonomy_request.h"
#include "server/ingest/fleet_view.h"
#include "server/ingest/forecasts.h"

namespace joulecast::api {

// What an autonomy answer says, before it is written in one dialect or another.
struct Autonomy {
  forecast::Charge charge;
  bool charge_is_live = false;
  double payload_kg = 0;
  forecast::Driving driving = forecast::Driving::usual;
  bool minimum_energy = false;
  forecast::Pace pace;
  std::optional<forecast::Limitation> limitation;  // the motors do not reach the pace
  forecast::Reach reach;
  std::optional<forecast::Outlook> outlook;                 // with a task list or a charger
  std::optional<forecast::Outlook> minimum_energy_outlook;  // the same, driven as the planner would
};

// infeasible when the charge is known from nowhere; invalid for a payload beyond the robot's limit.
Result<Autonomy> autonomy_of(const AutonomyRequest& request, const server::RobotOutlook& robot,
                             const server::RobotSnapshot* live, planning::CostTableCache& tables);

// JSON in the request's dialect.
std::string autonomy_json(const Autonomy& autonomy, const AutonomyRequest& request,
                          const server::RobotOutlook& robot, const server::RobotSnapshot* live);

// Both in one, from the JSON of a request.
Result<std::string> autonomy_answer(const nlohmann::json& body, const server::RobotOutlook& robot,
                                    const server::RobotSnapshot* live, planning::CostTableCache& tables);

// Where the robot is and what it declares to carry, as far as it is heard.
Whereabouts whereabouts(const server::RobotSnapshot* live);

// What is known of the charge: the request's, else the live one.
Result<forecast::Charge> charge_of(const std::optional<double>& given, const std::optional<double>& given_sd,
                                   const std::optional<double>& reserve, const robot::Battery& battery,
                                   const server::RobotSnapshot* live);

struct Services;
// The fleet call: {"robots": [...], "request": {...}}; a row a robot, in the order asked for or by id.
Result<std::string> fleet_autonomy_answer(const nlohmann::json& body, Services& services);

}  // namespace joulecast::api
