#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

namespace joulecast::virtual_robot {

// Deviations of the plant from its robot file. One strength per effect, 0 = none. Fractions unless a unit is
// named. Ids are the catalogue's; those that begin with x_ are effects that no catalogue contains.
struct Imperfections {
  // Torque at the wheel.
  double coulomb_friction = 0;         // of T_m
  double viscous_friction = 0;         // of nu
  double stribeck_friction = 0;        // of T_m, at zero speed
  double friction_asymmetry = 0;       // of T_m, on World::weak_side
  double load_rolling_resistance = 0;  // F = c m_p g, shared by the wheels
  double floor_resistance_zone = 0;    // F = c m g inside World::zone, shared by the wheels
  double slope = 0;                    // rad; F = m g sin(a) cos(heading - World::slope_direction_rad)
  double aerodynamic_drag = 0;         // N s^2/m^2; F = b v |v|
  double turning_scrub = 0;            // yaw moment c m g l / 2 against the turn
  double gear_efficiency = 0;          // of the torque that the gear passes on
  // Inertia.
  double chassis_mass_error = 0;
  double payload_mass_error = 0;
  double yaw_inertia_error = 0;
  double linear_inertia_error = 0;  // of the mass, as inertia only
  double com_offset = 0;            // m
  // Motor electrics.
  double resistance_error = 0;
  double winding_temperature = 0;   // K/W
  double brush_drop = 0;            // V
  double torque_constant_loss = 0;  // of K_t and K_w
  double inductance = 0;            // H
  // Battery side.
  double accessory_load = 0;   // W
  double driver_loss = 0;      // of |V i| of each motor
  double no_regeneration = 0;  // of each motor's braking power
  double battery_resistance = 0;
  // Kinematics.
  double wheel_radius_error = 0;
  double wheel_radius_asymmetry = 0;  // right (1 + a/2), left (1 - a/2)
  double track_error = 0;
  double wheel_slip = 0;  // of the wheel travel
  // Sensors.
  double current_sensor_gain = 0;  // motors and battery
  double current_sensor_bias = 0;  // A, motors and battery
  double voltage_sensor_gain = 0;  // motors and battery
  double sensor_delay = 0;         // s, electrical channels
  // Outside the catalogue.
  double x_radio_zone = 0;     // W inside World::zone
  double x_periodic_load = 0;  // W, half the time, World::period_s
  double x_cogging = 0;        // of T_m, T_m c sin^2(3 theta / 2): a wheel out of round
  double x_start_burst = 0;    // W, decays from the mission's start with World::burst_time_s
  double x_speed_cubed = 0;    // of T_m at the speed limit; T ~ w^3
  double x_heading_load = 0;   // W (1 + cos(heading - World::slope_direction_rad)) / 2
  double x_sag_load = 0;       // W per 1 % of battery sag
  double x_cold_bearing = 0;   // of T_m, decays from the mission's start with World::burst_time_s
  double x_cold_grease = 0;    // of T_m at the speed limit; T ~ w, decays like the cold bearing's
  double x_brake_drag = 0;     // of T_m, while a brake holds: irregular spells of some World::period_s / 3
  double x_oval_wheel = 0;     // of T_m, T_m c sin(theta): the axle rises and falls once a turn
  double x_floor_patches = 0;  // F = c m g (1 + sin(k x) sin(k y)) / 2, k = pi / World::patch_m
  double x_payload_speed = 0;  // F = c m_p g |v| / v_max: tyres that flex under load
  double x_turn_lamp = 0;      // W while the robot turns
  double x_warm_fan = 0;       // W per W of motor power, low-passed with World::burst_time_s
  // With a cause that the robot can publish.
  double grade = 0;       // steepest rise of a floor of hills; F = m g dh/ds, h = a/k sin(k x) cos(k y)
  double x_cpu_load = 0;  // W per unit of the on-board computer's load, which drifts between 0 and 1
};

// Shapes that the strengths do not determine.
struct World {
  double zone_x_m = 0, zone_y_m = 0, zone_radius_m = 3.5;
  double slope_direction_rad = 0;  // heading in which the floor rises
  int weak_side = 0;               // 0 right, 1 left
  double stribeck_speed_m_s = 0.12;
  double stribeck_power = 1;   // of the speed in the exponential
  double bristle_rad = 0.006;  // wheel angle over which dry friction builds up
  double emf_loss_share = 1;  // of torque_constant_loss that K_w has too; in SI units magnets cost both alike
  double thermal_time_constant_s = 240;
  double period_s = 24;
  double burst_time_s = 20;
  double patch_m = 1.2;
  double hill_m = 8;          // from top to top, k = 2 pi / hill_m
  double brush_softness = 1;  // of the current over which the brush drop builds up
  double motor_sensor_share = 1, battery_sensor_share = 1;  // of gains and biases of electrical sensors
};

struct EffectEntry {
  std::string_view id;
  double Imperfections::*strength;
  std::string_view unit;  // "1" for fractions
  double search_limit;    // the strongest that a search for a strength tries
  bool outside;           // beyond the catalogue
};

// Every injectable effect.
[[nodiscard]] std::span<const EffectEntry> all_effects();

using EffectStrength = std::pair<std::string, double>;

// Fault::invalid naming the unknown id, or a strength that is not finite.
[[nodiscard]] Result<Imperfections> make_imperfections(const std::vector<EffectStrength>& effects);
// Those of nonzero strength, in table order.
[[nodiscard]] std::vector<EffectStrength> effects_of(const Imperfections& imperfections);

}  // namespace joulecast::virtual_robot
