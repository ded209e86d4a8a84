#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "forecast/leg_cost.h"
#include "planning/path.h"
#include "server/api/fields.h"

namespace joulecast::api {

using forecast::StatedPace;

struct TaskRequest {
  std::string name;
  std::vector<forecast::PlannedLeg> legs;
  StatedPace pace;
  std::vector<forecast::PlannedLeg> to_charger;  // from where the task ends; empty: no charger given
  double greatest_payload_kg = 0;
};

enum class Dialect { joulecast, vda5050_3_0, vda5050_2_1, massrobotics, ros };
inline constexpr const char* dialect_names[] = {"joulecast", "vda5050-3.0", "vda5050-2.1", "massrobotics",
                                                "ros"};

struct AutonomyRequest {
  std::optional<double> state_of_charge;     // instead of the live one
  std::optional<double> state_of_charge_sd;  // of state_of_charge
  std::optional<double> reserve_fraction;    // instead of the robot file's
  std::optional<double> payload_kg;          // instead of the live one
  bool minimum_energy = false;               // the robot drives the planner's profiles
  bool compare_minimum_energy = false;
  double value_of_time_w = 0;  // of the planner's profiles
  StatedPace pace;
  double confidence = 0.95;
  std::vector<TaskRequest> tasks;
  bool halts_stated = false;  // a task dwells, or says that it does not: no others are foreseen
  std::vector<forecast::PlannedLeg> from_here;  // to the charger
  Dialect dialect = Dialect::joulecast;
};

// Where a robot is now and what it carries, where the request does not say.
struct Whereabouts {
  std::optional<planning::Pose> pose;
  std::optional<double> payload_kg;
};

// Reads everything of the request from `fields`, which the caller finishes. Tasks follow on one another from
// "start_pose", else from where the robot is, else from the origin. `single`: one robot is asked for, so that
// the comparison with the minimum-energy profile is made unless it is declined.
AutonomyRequest read_autonomy(Fields& fields, const Whereabouts& now, bool single);

// Whether the request means another thing for a robot elsewhere or with another payload.
bool depends_on_whereabouts(const nlohmann::json& request);

}  // namespace joulecast::api
