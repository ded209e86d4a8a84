#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "base/error.h"
#include "server/ingest/model_registry.h"

namespace joulecast::api {

struct ProfileRequest {
  double length_m = 0;
  double payload_kg = 0;
  double start_speed_m_s = 0;
  double end_speed_m_s = 0;
  std::optional<double> duration_s;  // absent: free, by transversality
  double value_of_time_w = 0;
  int samples = 101;
};
Result<ProfileRequest> parse_profile(const nlohmann::json& body, const robot::Limits& limits);

// JSON: the minimum-energy profile within the robot's limits, against a trapezoid and a triangle of the same
// duration.
Result<std::string> profile_answer(const ProfileRequest& request, const server::ModelInForce& model);

}  // namespace joulecast::api
