#pragma once

#include <array>
#include <string_view>

namespace joulecast::gap {

// Properties of an effect that the diagnosis uses and its formula does not contain. One row for each effect
// of the catalogue; a test compares the two lists.
struct Traits {
  std::string_view id;

  // Standard deviations of the strength, in its unit: in a robot that matches its file (calibration), and
  // from mission to mission. Both are scales: the posterior estimates a common factor on them from the data.
  // 0: from power alone.
  double tolerance = 0, scatter = 0;
  // Standard deviation of a strength worth a name where its effect on power is small; 0: from power alone.
  double usual = 0;
  // Visible in other channels than power (gyro, map, battery voltage, transients), even where it moves little
  // power.
  bool elsewhere = false;
  bool nonnegative = false;  // though the formula allows either sign
  // Cause of a change over a robot's life: wear, floor, battery, load, sensors, model.
  std::string_view cause = "model";
  std::string_view workshop{};  // part of the robot to check
  // Parameter of the robot file that the strength corrects, as a JSON pointer, and how; empty: none.
  std::string_view calibrates{};
  bool adds = false;  // strength is added to the parameter; otherwise it is (1 + strength) times the file's
};

// Tolerances are the standard errors that calibrations of a drive from its own recordings reach (calibrate.md
// prints them with every parameter). Scatter is the difference of their parameters from mission to mission.
// Both are a scale only: the factor by which a robot departs from it is averaged over, weighted by the data.
inline constexpr auto traits_table = std::to_array<Traits>({
    {"coulomb_friction", 0.008, 0.015, 5, false, false, "wear",
     "bearings, gear oil, brakes that drag; spin the wheels in the air by hand and compare the sides",
     "/motor/friction_torque_nm"},
    {"viscous_friction", 0.04, 0.03, 200, false, false, "wear", "gear oil: grade, level, temperature",
     "/motor/viscous_friction_nm_s_rad"},
    {"stribeck_friction", 0.02, 0, 5, false, false, "wear", "seals and bearings that stick at low speed"},
    {"friction_asymmetry", 0.006, 0.010, 5, false, false, "wear",
     "bearing, gear and brake of that side; swap wheels to see whether it moves with them"},
    {"load_rolling_resistance", 0, 0, 0, false, false, "floor",
     "tyres: pressure, tread, flat spots under load"},
    {"floor_resistance_zone", 0, 0, 0, false, false, "floor",
     "the floor at that place: carpet, dirt, damage"},
    {"slope", 0, 0, 0, false, false, "floor", "the level of the floor; the pitch sensor's zero"},
    {"grade", 0, 0, 0, false, false, "floor", "ramps and slopes of the floor; the zero of the pitch sensor"},
    {"aerodynamic_drag", 0, 0, 0, false, false, "load", "what the robot carries into the wind; its covers"},
    {"turning_scrub", 0, 0, 0, false, false, "floor",
     "castors that stick, tyre pressure, grip of the floor; wheels that do not point the same way"},
    {"gear_efficiency", 0, 0, 0, false, false, "wear", "gears: oil, wear, alignment; temperature under load"},
    {"chassis_mass_error", 0.006, 0, 0.6, false, false, "load", "weigh the robot", "/mass/chassis_kg"},
    {"payload_mass_error", 0.01, 0, 1, false, false, "load",
     "weigh what it carries; what the loader declares"},
    {"yaw_inertia_error", 0.02, 0, 3, false, false, "load", "where the masses sit; loads far off the centre",
     "/mass/yaw_inertia_kg_m2"},
    {"linear_inertia_error", 0.006, 0, 1, false, false, "load", "loads that slosh or swing; wheel inertia"},
    {"com_offset", 0.003, 0, 0.2, true, false, "load", "where the masses sit along the robot",
     "/kinematics/com_offset_m", true},
    {"resistance_error", 0.015, 0.010, 1, false, false, "wear",
     "motor winding, connectors and cables: measure ohms", "/motor/resistance_ohm"},
    {"winding_temperature", 0, 0, 0, false, false, "wear", "cooling of the motors"},
    // Both brushes together drop 0.5 to 3 V (Hughes and Drury, Electric Motors and Drives, section 3.3).
    {"brush_drop", 0.05, 0, 2, false, false, "wear", "brushes and commutator"},
    {"torque_constant_loss", 0.004, 0, 0.3, false, false, "wear",
     "magnets: heat, age; the gear ratio in the file"},
    {"inductance", 0, 0, 0, true, false, "model", "the motor's data sheet"},
    {"accessory_load", 0, 0, 0, false, false, "load",
     "what else draws power: computer, lights, heater, charger", "/idle_power_w", true},
    {"driver_loss", 0, 0, 0, false, false, "wear", "motor drivers: temperature, switching frequency"},
    {"no_regeneration", 0.02, 0, 0.6, false, false, "battery",
     "brake resistor, driver settings, a full battery"},
    {"battery_resistance", 0.15, 0, 1, true, false, "battery", "battery age and temperature, its connectors",
     "/battery/internal_resistance_ohm"},
    {"wheel_radius_error", 0.002, 0, 0.03, true, false, "wear", "wheel diameter under load, tyre pressure",
     "/kinematics/wheel_radius_m"},
    {"wheel_radius_asymmetry", 0.001, 0, 0.04, true, false, "wear", "both wheels' diameters and pressures"},
    {"track_error", 0.004, 0, 0.12, true, false, "model", "the distance between the contacts of the wheels",
     "/kinematics/half_track_m"},
    {"wheel_slip", 0.003, 0, 0.08, true, true, "floor", "grip: wet, dusty or soft floor, worn tyres"},
    {"current_sensor_gain", 0.004, 0, 0.1, false, false, "sensors",
     "current sensors: clamp meter next to them"},
    {"current_sensor_bias", 0, 0, 0, false, false, "sensors", "zero of the current sensors with all off"},
    {"voltage_sensor_gain", 0.003, 0, 0.1, false, false, "sensors",
     "voltage sensors: multimeter next to them"},
    {"sensor_delay", 0.004, 0, 0.1, true, false, "sensors",
     "filters and bus latency of the electrical sensors"},
});

constexpr const Traits& traits_of(std::string_view id) {
  for (const Traits& row : traits_table)
    if (row.id == id) return row;
  return traits_table.front();  // not reached: every effect has a row
}

}  // namespace joulecast::gap
