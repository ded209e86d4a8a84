#pragma once

#include <cstdint>
#include <memory>

#include "base/error.h"
#include "battery/charging.h"
#include "dynamics/drive_model.h"
#include "forecast/outlook.h"
#include "forecast/robot_forecast.h"
#include "planning/path.h"
#include "planning/planner.h"
#include "robot/robot_model.h"

namespace joulecast::answers {

// A robot's model in use: immutable, shared by reference.
struct ModelInForce {
  robot::RobotModel robot;
  dynamics::DriveModel drive;
  std::int64_t version = 0;
  planning::Planner planner;
};

// An effect that the catalogue rejects is an error.
Result<std::shared_ptr<const ModelInForce>> model_in_force(robot::RobotModel robot, std::int64_t version);

// Input of answers about a robot's future, at one moment.
struct RobotOutlook {
  std::shared_ptr<const ModelInForce> model;
  std::shared_ptr<const forecast::Forecaster> forecaster;
  std::shared_ptr<const forecast::ChargeMap> battery;
  bool siblings_pending = false;  // missions of its siblings are still being read
};

std::shared_ptr<const forecast::ChargeMap> charge_map(const robot::Battery& battery);

// Of a robot without any past: for answers from a robot file alone.
RobotOutlook untried(std::shared_ptr<const ModelInForce> model);

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
