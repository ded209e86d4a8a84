#pragma once

#include <string>

#include "answers/model.h"
#include "describe/schema.h"
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

// The message format of an autonomy answer.
enum class Dialect { joulecast, vda5050_3_0, vda5050_2_1, massrobotics, ros };
inline constexpr const char* dialect_names[] = {"joulecast", "vda5050-3.0", "vda5050-2.1", "massrobotics",
                                                "ros"};

// The status in another standard's format, JSON. Unknown values are omitted, in ROS null (its NaN).
// Rounded to a hundredth of a per cent, mV, mA and mAh; range and run time down, to metres and milli-hours.
//   VDA 5050 3.0  {"powerSupply": {...}}: percent, V, A (negative while discharging), m
//   VDA 5050 2.1  {"batteryState": {...}}: percent, V, whole percent of health, whole metres
//   MassRobotics  percent and hours, members of the status report
//   ROS           fields of sensor_msgs/BatteryState: fraction, A negative while discharging, Ah
std::string battery_dialect(Dialect dialect, const BatteryStatus& status);
// The schema of these messages.
described::Schema battery_status_schema();

}  // namespace joulecast::answers
