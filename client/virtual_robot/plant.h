#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "client/virtual_robot/imperfections.h"
#include "client/virtual_robot/robot_parameters.h"

namespace joulecast::virtual_robot {

// Dry friction as a bristle that bends before it slips (Canudas de Wit, Olsson, Astrom and Lischinsky 1995,
// LuGre), scaled so that |bend| = 1 is plain Coulomb sliding and the level may change on the way:
//   d bend/dt = (w - |w| bend / g(w)) / delta,  g(w) = 1 + s exp(-(|w|/w_s)^p),  T = level (bend + k_d d
//   bend/dt)
// delta [rad] is the wheel angle over which the bristle bends, w_s [rad/s] the Stribeck speed,
// p = 1 (as here unless given) or 2 as in much of the literature.
struct Bristle {
  static constexpr double damping_s = 0.004;
  static constexpr double damping_speed_rad_s = 0.05;  // beyond it the damping fades, or braking would jerk

  double bend_angle_rad = 0.006;
  double stribeck_fraction = 0;
  double stribeck_speed_rad_s = 1;
  double stribeck_power = 1;

  double bend_rate(double bend, double speed_rad_s) const {
    const double magnitude = std::abs(speed_rad_s);
    double slip_level = 1;
    if (stribeck_fraction != 0)
      slip_level += stribeck_fraction * std::exp(-std::pow(magnitude / stribeck_speed_rad_s, stribeck_power));
    return (speed_rad_s - magnitude * bend / slip_level) / bend_angle_rad;
  }

  // Torque against the motion over the friction level.
  static double torque_ratio(double bend, double bend_rate_1_s, double speed_rad_s) {
    const double fade = speed_rad_s / damping_speed_rad_s;
    return bend + damping_s / (1 + fade * fade) * bend_rate_1_s;
  }
};

// Factors near 1 by which one mission's robot differs from the file: bearings, grease, floor of the day.
struct MissionScatter {
  std::array<double, 2> friction{1, 1};
  double viscous = 1;
  double resistance = 1;
  double idle_power = 1;
};

// Mechanical and electrical state that is integrated together. Sides: [0] right, [1] left.
struct PlantState {
  double x_m = 0, y_m = 0, heading_rad = 0;
  std::array<double, 2> wheel_angle_rad{};
  std::array<double, 2> wheel_speed_rad_s{};
  std::array<double, 2> current_a{};
  std::array<double, 2> bend{};  // of the friction bristles
};

// Energy by account since the plant was made [J]. motor = copper + brush + conversion + internal + floor +
// gear + drag + scrub + slip + potential + change of stored, to the integrator's order (the balance that
// tests check). `internal` and `floor` include the energy in the bristles, a few millijoules.
struct PlantAccounts {
  double motor = 0;  // V i of both armatures
  double bus = 0;    // drawn by the drivers for it: braking power lost, driver loss added
  double copper = 0;
  double brush = 0;
  double conversion = 0;  // (K_w - K_t) n i w, zero when the constants agree
  double internal = 0;    // bearings and gear at no load, dry and viscous
  double floor = 0;       // rolling resistance of floor and payload
  double gear = 0;
  double drag = 0;
  double scrub = 0;
  double slip = 0;
  double potential = 0;  // against the slope
};

// from + by * rate, member by member, of a struct of doubles.
template <class T>
T moved(const T& from, const T& rate, double by) {
  using Flat = std::array<double, sizeof(T) / sizeof(double)>;
  auto a = std::bit_cast<Flat>(from);
  const auto r = std::bit_cast<Flat>(rate);
  for (std::size_t k = 0; k < a.size(); ++k) a[k] += by * r[k];
  return std::bit_cast<T>(a);
}

// The body, wheels and motors of a differential-drive robot, driven by the two armature voltages.
// Equations of motion from the kinetic energy of body and wheels without lateral slip, with the centre of
// mass off the axle, wheels of unequal radius and armature inductance; Runge-Kutta of order four at a fixed
// step.
class Plant {
 public:
  Plant(const RobotParameters& robot, const Imperfections& imperfections, const World& world);

  // Take a load and the scatter of a mission; time_since_start_s counts from here.
  void begin_mission(double payload_kg, double undeclared_kg, const MissionScatter& scatter);
  void set_payload(double declared_kg);
  void set_winding_rise(const std::array<double, 2>& kelvin);

  // Advance by step_s with the voltages held.
  void advance(const std::array<double, 2>& voltage_v, double step_s);
  // The longest step that is stable by a margin and resolves the fastest mode [s].
  double longest_step_s() const { return longest_step_s_; }

  const PlantState& state() const { return state_; }
  PlantState& state() { return state_; }
  const PlantAccounts& accounts() const { return accounts_; }

  double speed_m_s() const;
  double yaw_rate_rad_s() const;
  double climb_rad() const;  // of the floor along the heading, nose up positive
  double height_m() const;   // of the floor, above where x = y = 0
  std::array<double, 2> wheel_acceleration_rad_s2(const std::array<double, 2>& voltage_v) const;
  double motor_power_w(const std::array<double, 2>& voltage_v) const;  // V i of both
  double bus_power_w(const std::array<double, 2>& voltage_v) const;    // drawn by the drivers
  double stored_energy_j() const;                                      // kinetic and magnetic
  std::array<double, 2> copper_power_w() const;
  // Electrical loads that follow where the robot is, how it moves and how long it has been under way.
  double outside_load_w() const;

 private:
  struct Rates;
  struct Body {
    double force_n, moment_nm;
    double floor_n;     // resistance of the floor to rolling
    double dry_factor;  // of dry friction in the drives
  };
  Body body(const PlantState& s, double speed_m_s, double yaw_rate_rad_s, PlantAccounts& power) const;
  Rates rates(const PlantState& s, const std::array<double, 2>& voltage_v) const;
  double driver_power_w(double motor_power_w) const;
  double zone_share(double x_m, double y_m) const;
  double patch_share(double x_m, double y_m) const;
  double hill_rise(double x_m, double y_m, double heading_rad) const;
  bool brake_holds() const;
  void update_inertia();

  RobotParameters robot_;
  Imperfections effect_;
  World world_;
  MissionScatter scatter_;
  PlantState state_;
  PlantAccounts accounts_;
  Bristle bristle_;

  double payload_kg_ = 0;     // true one
  double undeclared_kg_ = 0;  // of it, on this mission
  double time_since_start_s_ = 0;
  double time_s_ = 0;              // since the plant was made
  double warmth_w_ = 0;            // motor power, low-passed
  std::array<double, 2> arm_m_{};  // travel of the body per wheel angle, slip included
  double half_track_m_ = 0;
  double torque_per_a_ = 0;   // K_t n
  double emf_per_rad_s_ = 0;  // K_w n
  double inductance_h_ = 0;
  std::array<double, 2> resistance_ohm_{};
  double brush_scale_a_ = 0;
  double weight_n_ = 0;
  double coupling_kg_m_ = 0;  // m_c d
  double inertial_mass_kg_ = 0;
  double yaw_inertia_kg_m2_ = 0;
  std::array<std::array<double, 2>, 2> inverse_inertia_{};
  std::array<double, 2> dry_nm_{};  // T_m of this mission, effects in
  double viscous_nm_s_rad_ = 0;
  double cubic_nm_s3_rad3_ = 0;
  double payload_floor_n_ = 0;
  double payload_flex_n_s_m_ = 0;
  double longest_step_s_ = 0;
};

// Battery: open-circuit voltage by charge, ohmic resistance and a resistor-capacitor branch for slow sag.
class Pack {
 public:
  // resistance_error: fraction by which both resistances exceed the file's.
  Pack(const RobotParameters& robot, double resistance_error, double state_of_charge);

  // Draw power_w (negative: charge) for a time step.
  void advance(double power_w, double step_s);

  // Terminal current and voltage while power_w is drawn. A demand beyond the pack's greatest power draws the
  // current of the greatest power.
  struct Terminals {
    double voltage_v;
    double current_a;
  };
  Terminals terminals(double power_w) const;

  // The power (negative) with which a charger of this greatest current and terminal voltage charges.
  double charging_power_w(double most_current_a, double most_voltage_v) const;

  double open_circuit_voltage_v() const;
  double full_voltage_v() const { return curve_.back().second; }  // at rest
  double capacity_ah() const { return capacity_c_ / 3600; }
  double state_of_charge() const { return charge_; }
  void exchange() { charge_ = exchanged_charge, branch_v_ = 0; }

  static constexpr double exchanged_charge = 0.95;

 private:
  std::vector<std::pair<double, double>> curve_;
  double resistance_ohm_;
  double branch_resistance_ohm_;
  double capacity_c_;
  double charge_;
  double branch_v_ = 0;
};

}  // namespace joulecast::virtual_robot
