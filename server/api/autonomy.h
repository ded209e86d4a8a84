#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/records.h"
#include "server/ingest/fleet_view.h"
#include "server/ingest/model_registry.h"

namespace joulecast::api {

struct AutonomyRequest {
  std::optional<double> state_of_charge;   // instead of the live one
  std::optional<double> reserve_fraction;  // instead of the robot file's
  std::optional<double> payload_kg;        // for the model's consumption, when no mission tells it
};
Result<AutonomyRequest> parse_autonomy(const nlohmann::json& body);

// What a robot spends: from its recent missions, or, where it has none, from the model at steady speed.
struct Consumption {
  std::string basis;  // "recent_missions" or "model"
  std::int64_t missions = 0;
  double energy_j = 0, distance_m = 0, duration_s = 0;
};
Consumption consumption_of(const std::vector<history::Mission>& recent, const server::ModelInForce& model,
                           double payload_kg);

// JSON of state of charge, usable energy, range and run time. infeasible when the charge is known from
// nowhere.
Result<std::string> autonomy_answer(const AutonomyRequest& request, const server::ModelInForce& model,
                                    const server::RobotSnapshot* live,
                                    const std::vector<history::Mission>& recent);

}  // namespace joulecast::api
