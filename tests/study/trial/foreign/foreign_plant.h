#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "client/virtual_robot/rng.h"

// A plant that shares no equation and no number with the product or with its virtual robot: two geared
// direct-current motors with inductance, friction by bristles, a sampled speed controller and instantaneous
// readings. [0] right, [1] left.
namespace joulecast::trial::foreign {

// The numbers of a robot file.
struct ForeignRobot {
  double radius_m = 0.1, half_track_m = 0.25;
  double chassis_kg = 60, wheel_kg = 2, yaw_inertia_kg_m2 = 4, wheel_inertia_kg_m2 = 0.02;
  double resistance_ohm = 0.4, inductance_h = 4e-4, constant_nm_a = 1;  // of motor and gear together
  double viscous_nm_s_rad = 0.02;
  std::array<double, 2> friction_nm{1, 1};
  double battery_v = 24, battery_ohm = 0.03, idle_w = 20;
  double speed_m_s = 1.2, acceleration_m_s2 = 0.6, yaw_rate_rad_s = 1.2, current_a = 30, payload_kg = 40;
};

// Strengths of departures from the robot file, in the units of the catalogue; 0: absent. Those from
// `switched_w` on are outside it.
struct Departures {
  double coulomb_ratio = 0, viscous_ratio = 0, right_friction_ratio = 0;
  double payload_rolling = 0, scrub = 0, drag_n_s2_m2 = 0, slope_rad = 0, gear_loss = 0;
  double chassis_ratio = 0, resistance_ratio = 0, constant_loss = 0, brush_v = 0;
  double accessory_w = 0, driver_loss = 0, unreturned = 0, current_gain = 0;
  double switched_w = 0;         // on for 6 of every 37 s
  double dragging_brake_nm = 0;  // of the left wheel, for some seconds after every third start
  double warming_nm = 0;         // of both wheels, approached within a minute
  double place_w = 0;            // within 1.5 m of a point
  double caster_nm = 0;  // of both wheels over the first metre after the direction of turning has changed
};

struct DepartureEntry {
  std::string_view id;  // of the catalogue, or x_... outside it
  double Departures::*strength;
  double most;    // upper limit of the strength
  bool downward;  // may be negative, down to -0.5
};
[[nodiscard]] const std::vector<DepartureEntry>& departures();

// Commands of a mission: wheel speeds at each controller period.
struct Drive {
  double payload_kg = 0;
  std::vector<std::array<double, 2>> wheel_rad_s;
};
inline constexpr double controller_period_s = 0.01;

// Legs between random points of a floor of 10 m, turns in place, arcs and halts.
[[nodiscard]] Drive draw_drive(const ForeignRobot& robot, double duration_s, virtual_robot::Rng& rng);

// State at one instant; true values.
struct ForeignState {
  double time_s = 0;
  std::array<double, 2> wheel_rad_s{}, current_a{}, voltage_v{}, torque_nm{};
  double battery_power_w = 0, battery_voltage_v = 0, battery_current_a = 0;
  double x_m = 0, y_m = 0, heading_rad = 0, yaw_rate_rad_s = 0;
};

// The states of a drive every `period_s`, from standstill. `resolution_s` is the step of the Runge-Kutta
// integration.
[[nodiscard]] std::vector<ForeignState> driven(const ForeignRobot& robot, const Departures& with,
                                               const Drive& drive, double period_s,
                                               double resolution_s = 2.5e-4);

}  // namespace joulecast::trial::foreign
