#include "client/virtual_robot/imperfections.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/nearest_word.h"

namespace joulecast::virtual_robot {
namespace {

using I = Imperfections;

constexpr auto table = std::to_array<EffectEntry>({
    {"coulomb_friction", &I::coulomb_friction, "1", 6, false},
    {"viscous_friction", &I::viscous_friction, "1", 120, false},
    {"stribeck_friction", &I::stribeck_friction, "1", 12, false},
    {"friction_asymmetry", &I::friction_asymmetry, "1", 8, false},
    {"load_rolling_resistance", &I::load_rolling_resistance, "1", 0.3, false},
    {"floor_resistance_zone", &I::floor_resistance_zone, "1", 0.3, false},
    {"slope", &I::slope, "rad", 0.2, false},
    {"aerodynamic_drag", &I::aerodynamic_drag, "N s^2/m^2", 200, false},
    {"turning_scrub", &I::turning_scrub, "1", 2, false},
    {"gear_efficiency", &I::gear_efficiency, "1", 0.7, false},
    {"chassis_mass_error", &I::chassis_mass_error, "1", 3, false},
    {"payload_mass_error", &I::payload_mass_error, "1", 3, false},
    {"yaw_inertia_error", &I::yaw_inertia_error, "1", 10, false},
    {"linear_inertia_error", &I::linear_inertia_error, "1", 3, false},
    {"com_offset", &I::com_offset, "m", 0.5, false},
    {"resistance_error", &I::resistance_error, "1", 5, false},
    {"winding_temperature", &I::winding_temperature, "K/W", 100, false},
    {"brush_drop", &I::brush_drop, "V", 3, false},
    {"torque_constant_loss", &I::torque_constant_loss, "1", 0.5, false},
    {"inductance", &I::inductance, "H", 0.5, false},
    {"accessory_load", &I::accessory_load, "W", 300, false},
    {"driver_loss", &I::driver_loss, "1", 0.9, false},
    {"no_regeneration", &I::no_regeneration, "1", 1, false},
    {"battery_resistance", &I::battery_resistance, "1", 15, false},
    {"wheel_radius_error", &I::wheel_radius_error, "1", 0.3, false},
    {"wheel_radius_asymmetry", &I::wheel_radius_asymmetry, "1", 0.2, false},
    {"track_error", &I::track_error, "1", 0.6, false},
    {"wheel_slip", &I::wheel_slip, "1", 0.4, false},
    {"current_sensor_gain", &I::current_sensor_gain, "1", 0.4, false},
    {"current_sensor_bias", &I::current_sensor_bias, "A", 5, false},
    {"voltage_sensor_gain", &I::voltage_sensor_gain, "1", 0.4, false},
    {"sensor_delay", &I::sensor_delay, "s", 0.5, false},
    {"x_radio_zone", &I::x_radio_zone, "W", 600, true},
    {"x_periodic_load", &I::x_periodic_load, "W", 600, true},
    {"x_cogging", &I::x_cogging, "1", 12, true},
    {"x_start_burst", &I::x_start_burst, "W", 1500, true},
    {"x_speed_cubed", &I::x_speed_cubed, "1", 30, true},
    {"x_heading_load", &I::x_heading_load, "W", 600, true},
    {"x_sag_load", &I::x_sag_load, "W", 600, true},
    {"x_cold_bearing", &I::x_cold_bearing, "1", 30, true},
    {"x_cold_grease", &I::x_cold_grease, "1", 60, true},
    {"x_brake_drag", &I::x_brake_drag, "1", 12, true},
    {"x_oval_wheel", &I::x_oval_wheel, "1", 12, true},
    {"x_floor_patches", &I::x_floor_patches, "1", 0.3, true},
    {"x_payload_speed", &I::x_payload_speed, "1", 0.6, true},
    {"x_turn_lamp", &I::x_turn_lamp, "W", 600, true},
    {"x_warm_fan", &I::x_warm_fan, "1", 5, true},
    // With a cause that the robot can publish.
    {"grade", &I::grade, "1", 0.2, false},
    {"x_cpu_load", &I::x_cpu_load, "W", 600, true},
});

}  // namespace

std::span<const EffectEntry> all_effects() {
  return table;
}

Result<Imperfections> make_imperfections(const std::vector<EffectStrength>& effects) {
  Imperfections result;
  for (const auto& [id, strength] : effects) {
    const auto* entry = std::find_if(table.begin(), table.end(), [&](const auto& e) { return e.id == id; });
    if (entry == table.end())
      return invalid("--effect", id + " is not an effect; --list-effects lists them" +
                                     did_you_mean(id, table, &EffectEntry::id));
    if (!std::isfinite(strength) || std::abs(strength) > entry->search_limit) {
      std::ostringstream text;
      text << "the strength of " << id << " must be -" << entry->search_limit << " to "
           << entry->search_limit;
      if (entry->unit != "1") text << ' ' << entry->unit;
      return invalid("--effect", text.str());
    }
    result.*(entry->strength) = strength;
  }
  return result;
}

std::vector<EffectStrength> effects_of(const Imperfections& imperfections) {
  std::vector<EffectStrength> result;
  for (const auto& entry : table)
    if (imperfections.*(entry.strength) != 0) result.emplace_back(entry.id, imperfections.*(entry.strength));
  return result;
}

}  // namespace joulecast::virtual_robot
