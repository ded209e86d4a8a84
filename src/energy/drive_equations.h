#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "dynamics/drive_model.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"
#include "windows/windows.h"

namespace joulecast::energy {

// Unknowns of a mission's equations: the parameters that are refined, and effects that could be mistaken for
// them. Load beyond the declared payload counts as mass.
enum class Unknown : std::size_t {
  friction_right,  // N m at the wheel
  friction_left,
  viscous,             // N m s/rad at the wheel
  idle_power,          // W
  mass,                // kg of the whole robot without payload
  battery_resistance,  // ohm
  slope_cos,           // rad: tilt of the floor along the map's x axis
  slope_sin,           // rad: ... along y
  scrub,               // 1: friction coefficient of turning contacts
  yaw_inertia,         // 1: error of the yaw inertia
  current_bias,        // A: offset of the motor current sensors
  driver_loss          // 1: share of the motors' power lost in the drivers
};
inline constexpr std::size_t unknown_count = 12;
inline constexpr std::size_t refined_count = 6;  // to battery_resistance: kept from mission to mission

inline constexpr std::array<std::string_view, refined_count> refined_names = {"friction_torque_right_nm",
                                                                              "friction_torque_left_nm",
                                                                              "viscous_friction_nm_s_rad",
                                                                              "idle_power_w",
                                                                              "mass_kg",
                                                                              "internal_resistance_ohm"};

// Linear equations of one mission: reading - model = row . (unknowns - the model's).
struct DriveEquation {
  // N m of one wheel; W of the battery without the motors; W of all; V of the battery, between two windows
  enum class Kind { torque, idle, power, voltage };
  Kind kind = Kind::torque;
  double value = 0;
  std::array<double, unknown_count> row{};
};

// Of the fastest wheel speed: friction of a slower wheel is not taken for dry and viscous friction alone,
// since it follows the Stribeck curve (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994),
// sec. 2). Refinement and calibration both use it. A window of windows/windows.h is moving from 0.1 rad/s
// on already: there only the sign of the friction must be sure, and its equations have a column for the
// curve.
inline constexpr double moving_share = 0.03;

// Turns a mission's samples into equations, one or two a smooth window (windows/windows.h). The rows are
// differences of the robot's own drive model, so that payloads and effects count as they do there.
//
// With motor currents: the torque balance of each moving wheel, K_t n i against the model's torque, and the
// battery's power less the motors'. With battery power alone: all of it against the model's. The battery's
// voltage over ten windows, about 2 s, against its current, where the file has one resistance for every
// charge and temperature: the open-circuit voltage and slow sag barely change in that time, while the current
// changes by far more than its noise (from one window to the next, noise made resistances of light robots 18
// % too low). Windows in which a wheel starts, stops or reverses, the payload changes, or samples are
// missing, are left out.
class DriveEquations {
 public:
  // Fault::invalid when the catalogue rejects an effect of the robot file.
  static Result<DriveEquations> make(const robot::RobotModel& robot);

  // In order of time, with the climb there (dynamics/climb.h).
  void add(const signals::Sample& sample, double climb_rad);
  void add(const signals::Sample& sample) { add(sample, sample.pitch_rad); }
  // Marks a break of the robot's time or motion: no window contains samples of both sides.
  void interrupt();

  // Returns the equations added since the last take(), and interrupts.
  std::vector<DriveEquation> take();
  // Mean declared payload over the windows of the last take().
  double mean_payload_kg() const { return mean_payload_kg_; }

 private:
  struct Varied {
    std::size_t unknown;
    double step;
    dynamics::DriveModel model;
  };

  DriveEquations(const robot::RobotModel& robot, dynamics::DriveModel model);
  void close_windows();
  void add(const windows::Window& window);
  void torque_equations(const dynamics::Instant& at, const windows::Window& window);
  void idle_equation(const windows::Window& window);
  void power_equation(const dynamics::Instant& at, double power_w);
  void voltage_equation(const windows::Window& window);

  robot::RobotModel robot_;
  dynamics::DriveModel model_;
  std::vector<Varied> varied_;
  bool one_resistance_ = true;
  double torque_per_a_ = 1;
  double moving_rad_s_ = 0;
  double payload_sum_kg_ = 0, windows_ = 0, mean_payload_kg_ = 0;
  telemetry::Recording recording_;             // of which windows are to be made
  std::deque<std::array<double, 2>> battery_;  // voltage and current of the newest windows
  std::vector<DriveEquation> equations_;
};

}  // namespace joulecast::energy
