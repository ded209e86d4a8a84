#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "client/virtual_robot/simulate.h"
#include "dynamics/drive_model.h"
#include "forecast/leg.h"
#include "forecast/outlook.h"
#include "forecast/robot_forecast.h"
#include "robot/robot_model.h"

namespace joulecast::forecast {

// A leg of a planned mission with the pace that its plan states.
struct StatedLeg {
  PlannedLeg leg;
  double speed = 0, acceleration = 0;  // of a moving leg: m or rad
};

// One mission of a virtual robot: what was planned, what the service saw of it, and what it truly cost.
struct VirtualMission {
  std::vector<StatedLeg> plan;
  PastMission past;
  double metered_j = 0;  // by the service's meter, noise and sensor faults included
  double true_j = 0;
  double distance_m = 0;
  double charge_at_start = 0, charge_at_end = 0;
};

struct VirtualRobotRun {
  robot::RobotModel robot;  // what the service believes
  dynamics::DriveModel drive;
  std::vector<virtual_robot::EffectStrength> effects;  // what it does not know
  std::vector<VirtualMission> missions;
};

// A robot of the shipped kind whose plant departs from its file by two to four effects drawn from the seed;
// sensors are noisy, payloads change from mission to mission, days differ as `scatter` says.
// `departing`: false gives a plant true to its file.
VirtualRobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed,
                                  bool departing = true);

// As above, with the effects given.
VirtualRobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed,
                                  const std::vector<virtual_robot::EffectStrength>& effects);

// The plan priced as it states its pace, or at the robot's habit.
std::vector<PricedLeg> price_plan(const VirtualRobotRun& run, const VirtualMission& mission,
                                  const Forecaster& forecaster, Driving driving);

}  // namespace joulecast::forecast
