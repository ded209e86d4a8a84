#include "robot/kind.h"

#include <fmt/format.h>

namespace joulecast::robot {

std::string kind_of(const RobotModel& r) {
  return fmt::format("{:.6g} {:.6g} {:.6g} {:.6g} {:.6g} {:.6g} {:.6g} {:.6g}", r.mass.wheel_kg,
                     r.mass.wheel_inertia_kg_m2, r.motor.gear_ratio, r.motor.inductance_h,
                     r.battery.nominal_voltage_v, r.battery.capacity_ah, r.limits.current_a,
                     r.limits.payload_kg);
}

}  // namespace joulecast::robot
