#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "base/error.h"
#include "server/ingest/model_registry.h"

namespace joulecast::api {

// A plan this little above the shortest time, relatively, is as fast as the robot can: ten times what the
// planner meets deadlines to.
inline constexpr double at_the_limit = 1e-3;

// JSON: the minimum-energy motion along the requested path within the robot's limits, its ledger and
// certificate, against a trapezoid and a triangle that take as long on every run between stops; with
// "pareto_points", the front of energy against time.
Result<std::string> profile_answer(const nlohmann::json& request, const server::ModelInForce& model);

// The same text where it takes no more than some tens of microseconds; nothing for longer ones and for
// errors.
std::optional<std::string> brief_profile_answer(const nlohmann::json& request,
                                                const server::ModelInForce& model);

// JSON: energy and ledger of a motion: of the profile that the request gives, or of the best one along its
// path.
Result<std::string> estimate_answer(const nlohmann::json& request, const server::ModelInForce& model);

}  // namespace joulecast::api
