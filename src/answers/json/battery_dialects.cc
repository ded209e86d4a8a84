#include "answers/json/battery_dialects.h"

#include <algorithm>
#include <cmath>

#include "base/json_writer.h"

namespace joulecast::answers {
namespace {

// Constants of sensor_msgs/BatteryState.
enum RosStatus { ros_unknown = 0, ros_charging = 1, ros_discharging = 2, ros_not_charging = 3, ros_full = 4 };
constexpr int ros_health_unknown = 0, ros_health_good = 1;

constexpr double good_health = 0.7;
constexpr double longest_reach_m = 4294967295;  // VDA 5050 2.1: an unsigned integer of 32 bits

void known(JsonWriter& json, std::string_view name, double value) {
  if (std::isfinite(value)) json.field(name, value);
}

// To `digits` places; further ones are below the accuracy of batteries.
double rounded(double value, int digits) {
  const double scale = std::pow(10.0, digits);
  return std::round(value * scale) / scale + 0.0;  // no negative zero
}
// A promised range or run time is not rounded up.
double promised(double value, int digits) {
  const double scale = std::pow(10.0, digits);
  return std::floor(value * scale) / scale;
}

double percent(double fraction) {
  return rounded(std::clamp(100 * fraction, 0.0, 100.0), 2);
}

constexpr int milli = 3;

}  // namespace

std::string battery_dialect(Dialect dialect, const BatteryStatus& s) {
  JsonWriter json;
  json.begin_object();
  switch (dialect) {
    case Dialect::joulecast:
      break;
    case Dialect::vda5050_3_0:
      json.key("powerSupply").begin_object().field("stateOfCharge", percent(s.charge));
      known(json, "batteryVoltage", rounded(s.voltage_v, milli));
      known(json, "batteryCurrent", rounded(-s.current_a, milli));
      if (std::isfinite(s.health)) json.field("batteryHealth", percent(s.health));
      json.field("charging", s.charging);
      known(json, "range", promised(s.range_m, 0));
      json.end_object();
      break;
    case Dialect::vda5050_2_1:
      json.key("batteryState").begin_object().field("batteryCharge", percent(s.charge));
      known(json, "batteryVoltage", rounded(s.voltage_v, milli));
      if (std::isfinite(s.health))
        json.field("batteryHealth", static_cast<std::int64_t>(std::floor(percent(s.health))));
      json.field("charging", s.charging);
      if (std::isfinite(s.range_m))
        json.field("reach", static_cast<std::int64_t>(promised(std::min(s.range_m, longest_reach_m), 0)));
      json.end_object();
      break;
    case Dialect::massrobotics:
      json.field("batteryPercentage", percent(s.charge));
      known(json, "remainingRunTime", promised(s.run_time_s / 3600, milli));
      break;
    case Dialect::ros: {
      const double capacity_ah = s.rated_capacity_ah * (std::isfinite(s.health) ? s.health : 1);
      const int status = s.full                        ? ros_full
                         : s.charging                  ? ros_charging
                         : !std::isfinite(s.current_a) ? ros_unknown
                         : s.current_a > 0             ? ros_discharging
                                                       : ros_not_charging;
      json.field("voltage", rounded(s.voltage_v, milli)).field("temperature", std::nan(""));
      json.field("current", rounded(-s.current_a, milli))
          .field("charge", rounded(s.charge * capacity_ah, milli));
      json.field("capacity", rounded(capacity_ah, milli)).field("design_capacity", s.rated_capacity_ah);
      json.field("percentage", rounded(s.charge, 4)).field("power_supply_status", status);
      json.field("power_supply_health",
                 std::isfinite(s.health) && s.health >= good_health ? ros_health_good : ros_health_unknown);
      json.field("power_supply_technology", s.ros_technology).field("present", true);
      json.key("cell_voltage").begin_array().end_array();
      json.key("cell_temperature").begin_array().end_array();
      json.field("location", "").field("serial_number", "");
      break;
    }
  }
  json.end_object();
  return json.take();
}

}  // namespace joulecast::answers
