#pragma once

#include <string>

#include "answers/battery_status.h"
#include "describe/schema.h"

namespace joulecast::answers {

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
