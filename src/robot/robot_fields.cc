#include "robot/robot_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/xpressive/xpressive_dynamic.hpp>

namespace joulecast::robot {
namespace {

constexpr Bounds any;
constexpr Bounds above(double low, double high) {
  return {low, high, true, false};
}
constexpr Bounds within(double low, double high) {
  return {low, high, false, false};
}
constexpr Bounds below_end(double low, double high) {
  return {low, high, false, true};
}

// Pointer and member of an entry: the member is reached through a captureless function of the model.
#define AT(pointer, path) "/" pointer, +[](RobotModel& m) -> decltype((m.path)) { return m.path; }
#define FIELD(name) AT(#name, name)
#define FIELD_OF(object, name) AT(#object "/" #name, object.name)

// The ends are those of ground robots with a margin of orders of magnitude: they catch units mixed up
// (millimetres, grams, watt-hours) and signs, not unusual designs.
const Field table[] = {
    {FIELD(robot_id), any, "as in its telemetry"},
    {FIELD_OF(kinematics, wheel_radius_m), above(0, 2), "of a driven wheel under load"},
    {FIELD_OF(kinematics, half_track_m), above(0, 5), "half the distance between the wheels"},
    {FIELD_OF(kinematics, com_offset_m), within(-5, 5),
     "centre of mass ahead of the axle; negative is behind", Presence::optional},
    {FIELD_OF(mass, chassis_kg), above(0, 1e5), "without wheels, rotors and payload"},
    {FIELD_OF(mass, wheel_kg), within(0, 1e4), "one wheel with its rotor"},
    {FIELD_OF(mass, yaw_inertia_kg_m2), above(0, 1e6),
     "whole robot without payload, about the vertical through the axle's middle"},
    {FIELD_OF(mass, wheel_inertia_kg_m2), within(0, 1e4), "one wheel about its axle"},
    {FIELD_OF(mass, payload_yaw_inertia_m2), within(0, 100),
     "yaw inertia that each kilogram of payload adds: its radius of gyration squared, (a² + b²) / 12 of a "
     "homogeneous box, 0.17 of a pallet of 1.2 m by 0.8 m; absent: 0.02",
     Presence::optional},
    {FIELD_OF(motor, resistance_ohm), above(0, 1e3), "of one armature"},
    {FIELD_OF(motor, inductance_h), within(0, 10), "of one armature", Presence::optional},
    {FIELD_OF(motor, torque_constant_nm_a), above(0, 1e3), "at the motor shaft"},
    {FIELD_OF(motor, voltage_constant_v_s_rad), above(0, 1e3), "at the motor shaft"},
    {FIELD_OF(motor, gear_ratio), above(0, 1e4), "motor turns for one turn of the wheel", Presence::optional},
    {FIELD_OF(motor, rotor_inertia_kg_m2), within(0, 1e4), "seen at the wheel", Presence::optional},
    {FIELD_OF(motor, viscous_friction_nm_s_rad), within(0, 1e4), "at the wheel"},
    {FIELD_OF(motor, friction_torque_nm), within(0, 1e4), "at the wheel, opposing motion, [right, left]"},
    {FIELD_OF(battery, nominal_voltage_v), above(0, 2e3),
     "nominal voltage of the battery; upper limit of the motor voltage"},
    {FIELD_OF(battery, capacity_ah), above(0, 1e5), "rated capacity, when new"},
    {FIELD_OF(battery, internal_resistance_ohm), within(0, 100), "ohmic, from the terminals to the cells"},
    {FIELD_OF(battery, reserve_fraction), below_end(0, 1), "share of the charge that planning does not use"},
    {FIELD_OF(battery, open_circuit_voltage), above(0, 4e3),
     "voltage at rest over the state of charge, from 0 to 1 ascending", Presence::optional, "voltage_v"},
    {FIELD_OF(battery, resistance_curve), within(0, 100),
     "ohmic resistance over the state of charge, ascending, constant beyond its ends; the branches' "
     "resistances hold at charge 0.5 and follow its shape",
     Presence::optional, "resistance_ohm"},
    {FIELD_OF(battery, branches), any, "resistor-capacitor branches of the equivalent circuit",
     Presence::optional},
    {FIELD_OF(battery, charge_lags), any,
     "diffusion: at a steady current the charge that determines the voltage leads the mean charge by the "
     "charge that the current draws in lag_s",
     Presence::optional},
    {FIELD_OF(battery, cutoff_voltage_v), above(0, 2e3), "voltage under load at which the battery is empty",
     Presence::optional},
    {FIELD_OF(battery, coulombic_efficiency), above(0, 1), "charge returned over charge put in",
     Presence::optional},
    {FIELD_OF(battery, ageing_factor), above(0, 1.2), "present over rated capacity", Presence::optional},
    {FIELD_OF(battery, activation_k), within(0, 1e4),
     "every resistance and charge lag is multiplied by exp(this * (1/T - 1/298.15 K)); the curves hold at 25 "
     "degrees Celsius",
     Presence::optional},
    {FIELD_OF(battery, thermal_resistance_k_w), within(0, 1e3),
     "from the battery to its surroundings; its own losses heat it", Presence::optional},
    {FIELD_OF(battery, thermal_time_constant_s), above(0, 1e6), "time constant of warming and cooling",
     Presence::optional},
    {FIELD(idle_power_w), within(0, 1e5), "power at rest with the drives off"},
    {FIELD_OF(limits, speed_m_s), above(0, 50), "forward speed"},
    {FIELD_OF(limits, acceleration_m_s2), above(0, 100), "forward acceleration and braking"},
    {FIELD_OF(limits, yaw_rate_rad_s), above(0, 100), "rate of turning"},
    {FIELD_OF(limits, current_a), above(0, 1e4), "armature current of each motor"},
    {FIELD_OF(limits, payload_kg), within(0, 1e5), "mass of the payload"},
    {FIELD(effects), any,
     "adopted effects: catalogue id to its parameters; ids, names and bounds are those of the effect "
     "catalogue",
     Presence::optional},
};

#undef FIELD_OF
#undef FIELD
#undef AT

const ElementField<BatteryBranch> branch_table[] = {
    {"resistance_ohm", &BatteryBranch::resistance_ohm, within(0, 100), "of the branch"},
    {"time_constant_s", &BatteryBranch::time_constant_s, above(0, 1e6), "of the branch"},
};

const ElementField<ChargeLag> lag_table[] = {
    {"lag_s", &ChargeLag::lag_s, within(0, 1e5), "lead of the charge at the surface"},
    {"time_constant_s", &ChargeLag::time_constant_s, above(0, 1e6), "time constant of the lead"},
};

constexpr ObjectWords objects[] = {
    {"/kinematics", "wheels and centre of mass"},
    {"/mass", "masses and inertias"},
    {"/motor", "motors, gears and friction; both sides alike where a value is one number"},
    {"/battery",
     "the first four members are sufficient; the others refine the model and are determined by `joulecast "
     "calibrate battery`"},
    {"/limits", "limits of the robot's motion and payload"},
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
    {"_m2", "m²"},
    {"_m", "m"},
    {"_h", "H"},
    {"_v", "V"},
    {"_w", "W"},
    {"_a", "A"},
    {"_s", "s"},
    {"_k", "K"},
};

bool matches(std::string_view text, std::string_view pattern) {
  return regex_match(text.begin(), text.end(),
                     boost::xpressive::cregex::compile(pattern.begin(), pattern.end()));
}

}  // namespace

std::span<const Field> fields() {
  return table;
}

template <>
std::span<const ElementField<BatteryBranch>> element_fields() {
  return branch_table;
}

template <>
std::span<const ElementField<ChargeLag>> element_fields() {
  return lag_table;
}

std::span<const ObjectWords> object_words() {
  return objects;
}

bool is_robot_id(std::string_view text) {
  return matches(text, robot_id_pattern);
}

bool is_effect_name(std::string_view text) {
  return matches(text, effect_name_pattern);
}

std::string_view unit_of(std::string_view name) {
  const auto unit = std::find_if(std::begin(units), std::end(units),
                                 [&](const Unit& candidate) { return name.ends_with(candidate.suffix); });
  return unit == std::end(units) ? std::string_view{} : unit->symbol;
}

std::string kind_of(const RobotModel& r) {
  return fmt::format("{:.6g} {:.6g} {:.6g} {:.6g} {:.6g} {:.6g} {:.6g} {:.6g}", r.mass.wheel_kg,
                     r.mass.wheel_inertia_kg_m2, r.motor.gear_ratio, r.motor.inductance_h,
                     r.battery.nominal_voltage_v, r.battery.capacity_ah, r.limits.current_a,
                     r.limits.payload_kg);
}

}  // namespace joulecast::robot
