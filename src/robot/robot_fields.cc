#include "robot/robot_fields.h"

#include <algorithm>

namespace joulecast::robot {
namespace {

constexpr Bounds above(double low, double high) {
  return {low, high, true, false};
}
constexpr Bounds within(double low, double high) {
  return {low, high, false, false};
}
constexpr Bounds below_end(double low, double high) {
  return {low, high, false, true};
}

// One entry of the table: the member is reached through a captureless function of the model.
#define JOULECAST_MEMBER(path) +[](RobotModel& m) -> decltype((m.path)) { return m.path; }

// The ends are those of ground robots with a margin of orders of magnitude: they catch units mixed up
// (millimetres, grams, watt-hours) and signs, not unusual designs.
const Field table[] = {
    {"/robot_id", JOULECAST_MEMBER(robot_id)},

    {"/kinematics/wheel_radius_m", JOULECAST_MEMBER(kinematics.wheel_radius_m), above(0, 2)},
    {"/kinematics/half_track_m", JOULECAST_MEMBER(kinematics.half_track_m), above(0, 5)},
    {"/kinematics/com_offset_m", JOULECAST_MEMBER(kinematics.com_offset_m), within(-5, 5),
     Presence::optional},

    {"/mass/chassis_kg", JOULECAST_MEMBER(mass.chassis_kg), above(0, 1e5)},
    {"/mass/wheel_kg", JOULECAST_MEMBER(mass.wheel_kg), within(0, 1e4)},
    {"/mass/yaw_inertia_kg_m2", JOULECAST_MEMBER(mass.yaw_inertia_kg_m2), above(0, 1e6)},
    {"/mass/wheel_inertia_kg_m2", JOULECAST_MEMBER(mass.wheel_inertia_kg_m2), within(0, 1e4)},

    {"/motor/resistance_ohm", JOULECAST_MEMBER(motor.resistance_ohm), above(0, 1e3)},
    {"/motor/inductance_h", JOULECAST_MEMBER(motor.inductance_h), within(0, 10), Presence::optional},
    {"/motor/torque_constant_nm_a", JOULECAST_MEMBER(motor.torque_constant_nm_a), above(0, 1e3)},
    {"/motor/voltage_constant_v_s_rad", JOULECAST_MEMBER(motor.voltage_constant_v_s_rad), above(0, 1e3)},
    {"/motor/gear_ratio", JOULECAST_MEMBER(motor.gear_ratio), above(0, 1e4), Presence::optional},
    {"/motor/rotor_inertia_kg_m2", JOULECAST_MEMBER(motor.rotor_inertia_kg_m2), within(0, 1e4),
     Presence::optional},
    {"/motor/viscous_friction_nm_s_rad", JOULECAST_MEMBER(motor.viscous_friction_nm_s_rad), within(0, 1e4)},
    {"/motor/friction_torque_nm", JOULECAST_MEMBER(motor.friction_torque_nm), within(0, 1e4)},

    {"/battery/nominal_voltage_v", JOULECAST_MEMBER(battery.nominal_voltage_v), above(0, 2e3)},
    {"/battery/capacity_ah", JOULECAST_MEMBER(battery.capacity_ah), above(0, 1e5)},
    {"/battery/internal_resistance_ohm", JOULECAST_MEMBER(battery.internal_resistance_ohm), within(0, 100)},
    {"/battery/reserve_fraction", JOULECAST_MEMBER(battery.reserve_fraction), below_end(0, 1)},
    {"/battery/open_circuit_voltage", JOULECAST_MEMBER(battery.open_circuit_voltage), above(0, 4e3),
     Presence::optional, "voltage_v"},
    {"/battery/resistance_curve", JOULECAST_MEMBER(battery.resistance_curve), within(0, 100),
     Presence::optional, "resistance_ohm"},
    {"/battery/branches", JOULECAST_MEMBER(battery.branches), {}, Presence::optional},
    {"/battery/charge_lags", JOULECAST_MEMBER(battery.charge_lags), {}, Presence::optional},
    {"/battery/cutoff_voltage_v", JOULECAST_MEMBER(battery.cutoff_voltage_v), above(0, 2e3),
     Presence::optional},
    {"/battery/coulombic_efficiency", JOULECAST_MEMBER(battery.coulombic_efficiency), above(0, 1),
     Presence::optional},
    {"/battery/ageing_factor", JOULECAST_MEMBER(battery.ageing_factor), above(0, 1.2), Presence::optional},

    {"/battery/activation_k", JOULECAST_MEMBER(battery.activation_k), within(0, 1e4), Presence::optional},
    {"/battery/thermal_resistance_k_w", JOULECAST_MEMBER(battery.thermal_resistance_k_w), within(0, 1e3),
     Presence::optional},
    {"/battery/thermal_time_constant_s", JOULECAST_MEMBER(battery.thermal_time_constant_s), above(0, 1e6),
     Presence::optional},

    {"/idle_power_w", JOULECAST_MEMBER(idle_power_w), within(0, 1e5)},

    {"/limits/speed_m_s", JOULECAST_MEMBER(limits.speed_m_s), above(0, 50)},
    {"/limits/acceleration_m_s2", JOULECAST_MEMBER(limits.acceleration_m_s2), above(0, 100)},
    {"/limits/yaw_rate_rad_s", JOULECAST_MEMBER(limits.yaw_rate_rad_s), above(0, 100)},
    {"/limits/current_a", JOULECAST_MEMBER(limits.current_a), above(0, 1e4)},
    {"/limits/payload_kg", JOULECAST_MEMBER(limits.payload_kg), within(0, 1e5)},

    {"/effects", JOULECAST_MEMBER(effects), {}, Presence::optional},
};

#undef JOULECAST_MEMBER

const ElementField<BatteryBranch> branch_table[] = {
    {"resistance_ohm", &BatteryBranch::resistance_ohm, within(0, 100)},
    {"time_constant_s", &BatteryBranch::time_constant_s, above(0, 1e6)},
};

const ElementField<ChargeLag> lag_table[] = {
    {"lag_s", &ChargeLag::lag_s, within(0, 1e5)},
    {"time_constant_s", &ChargeLag::time_constant_s, above(0, 1e6)},
};

struct Unit {
  std::string_view suffix;
  std::string_view symbol;
};

// Longer suffixes before those that end them.
constexpr Unit units[] = {
    {"_nm_s_rad", "N m s/rad"},
    {"_v_s_rad", "V s/rad"},
    {"_kg_m2", "kg m²"},
    {"_rad_s", "rad/s"},
    {"_nm_a", "N m/A"},
    {"_m_s2", "m/s²"},
    {"_m_s", "m/s"},
    {"_k_w", "K/W"},
    {"_ohm", "ohm"},
    {"_nm", "N m"},
    {"_kg", "kg"},
    {"_ah", "Ah"},
    {"_m", "m"},
    {"_h", "H"},
    {"_v", "V"},
    {"_w", "W"},
    {"_a", "A"},
    {"_s", "s"},
    {"_k", "K"},
};

template <class Allowed>
bool is_name(std::string_view text, std::size_t longest, Allowed allowed) {
  return !text.empty() && text.size() <= longest && std::all_of(text.begin(), text.end(), allowed);
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_lower(char c) {
  return c >= 'a' && c <= 'z';
}
bool is_upper(char c) {
  return c >= 'A' && c <= 'Z';
}

}  // namespace

std::span<const Field> fields() {
  return table;
}

std::span<const ElementField<BatteryBranch>> branch_fields() {
  return branch_table;
}

std::span<const ElementField<ChargeLag>> lag_fields() {
  return lag_table;
}

bool is_robot_id(std::string_view text) {
  return is_name(text, 47, [](char c) {
    return is_digit(c) || is_lower(c) || is_upper(c) || c == '.' || c == '_' || c == '-';
  });
}

bool is_effect_name(std::string_view text) {
  return is_name(text, 64, [](char c) { return is_digit(c) || is_lower(c) || c == '_'; });
}

std::string_view unit_of(std::string_view name) {
  const auto unit = std::find_if(std::begin(units), std::end(units),
                                 [&](const Unit& candidate) { return name.ends_with(candidate.suffix); });
  return unit == std::end(units) ? std::string_view{} : unit->symbol;
}

}  // namespace joulecast::robot
