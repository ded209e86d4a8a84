#pragma once

#include <limits>
#include <optional>
#include <string>

#include "battery/charging.h"
#include "planning/path.h"

namespace joulecast::answers {

// A robot's live state, as far as answers need it. NaN: unknown.
struct LiveRobot {
  std::optional<planning::Pose> pose;
  std::optional<double> payload_kg;
  double state_of_charge = std::numeric_limits<double>::quiet_NaN();
  double state_of_charge_sd = std::numeric_limits<double>::quiet_NaN();
  std::string charge_limitation;  // battery::limitation_of
  battery::ChargingPhase charging = battery::ChargingPhase::none;
  battery::ChargingTime to_full;  // until the charger's end; away from it, if the robot went there now
  double battery_voltage_v = std::numeric_limits<double>::quiet_NaN();
  double battery_current_a = std::numeric_limits<double>::quiet_NaN();
  double speed_m_s = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace joulecast::answers
