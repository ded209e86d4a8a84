#pragma once

#include "answers/live.h"
#include "forecast/outlook.h"
#include "robot/robot_model.h"

namespace joulecast::answers {

// Input of the standards' battery messages, in this project's units and signs. NaN: unknown.
struct BatteryStatus {
  double charge = 0;     // 0 to 1
  double health = 1;     // present over rated capacity
  double voltage_v = 0;  // terminals; the model's where it is not measured
  double current_a = 0;  // positive while discharging
  double rated_capacity_ah = 0;
  double range_m = 0;     // that nineteen of twenty such drives exceed
  double run_time_s = 0;  // likewise
  bool charging = false;
  bool full = false;
  int ros_technology = 0;  // POWER_SUPPLY_TECHNOLOGY_* of sensor_msgs/BatteryState
};

BatteryStatus battery_status(const robot::Battery& battery, const forecast::ChargeMap& map,
                             const forecast::Charge& charge, const forecast::Reach& reach,
                             const LiveRobot& now);

}  // namespace joulecast::answers
