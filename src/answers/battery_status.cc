#include "answers/battery_status.h"

#include <cmath>
#include <string_view>

#include "battery/cell_shapes.h"

namespace joulecast::answers {
namespace {

constexpr double least_current_share = 0.01;  // of the capacity, an hour: weaker currents are no charging
constexpr int ros_lithium_ion = 2, ros_iron_phosphate = 4;

}  // namespace

BatteryStatus battery_status(const robot::Battery& battery, const forecast::ChargeMap& map,
                             const forecast::Charge& charge, const forecast::Reach& reach,
                             const LiveRobot& now) {
  BatteryStatus s;
  s.charge = charge.fraction;
  s.health = battery.ageing_factor.value_or(std::nan(""));
  s.rated_capacity_ah = battery.capacity_ah;
  s.voltage_v = now.battery_voltage_v;
  s.current_a = now.battery_current_a;
  // Regeneration is not charging: the service's detected phase counts, and before it has one, the current of
  // a robot that stands.
  const battery::ChargingPhase phase = now.charging;
  const double weak_a = least_current_share * battery.capacity_ah;
  const bool standing = !(std::fabs(now.speed_m_s) > 0);
  s.full = phase == battery::ChargingPhase::full;
  s.charging = phase == battery::ChargingPhase::constant_current || phase == battery::ChargingPhase::taper ||
               (phase != battery::ChargingPhase::full && standing && s.current_a < -weak_a);
  if (!std::isfinite(s.voltage_v))
    s.voltage_v = map.circuit().inner_voltage_v(battery::Circuit::rested(s.charge));
  s.range_m = reach.range_m[0];
  s.run_time_s = reach.run_time_s[0];
  const std::string_view chemistry = battery::detect_pack(battery.nominal_voltage_v).cell->chemistry;
  if (chemistry.find("phosphate") != std::string_view::npos) {
    s.ros_technology = ros_iron_phosphate;
  } else if (chemistry.find("lithium") != std::string_view::npos) {
    s.ros_technology = ros_lithium_ion;
  }
  return s;
}

}  // namespace joulecast::answers
