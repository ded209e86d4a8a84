#pragma once

#include <array>

#include "dynamics/drive_model.h"

namespace joulecast::dynamics {

// State of forward motion, thesis (2-42) with armature currents: position of the axle's middle, heading,
// wheel speeds.
struct DriveState {
  double x_m = 0, y_m = 0, heading_rad = 0;
  double climb_rad = unknown;  // of the floor there: given, not moved
  std::array<double, 2> wheel_angle_rad{};
  std::array<double, 2> wheel_speed_rad_s{};
  std::array<double, 2> current_a{};
  std::array<double, 2> copper_heat_w{};
};

// Wheel accelerations that the motors' torques produce [rad/s^2]: the inverse of BasicDriveModel::balance,
// thesis (2-41). The balance is affine in the accelerations except for gear loss; Newton's method crosses its
// kink in a few steps.
std::array<double, 2> wheel_accelerations(const DriveModel& model, const DriveState& state, double payload_kg,
                                          const std::array<double, 2>& torque_nm);

// Time derivative of the state under armature voltages, thesis (2-43) with the winding's inductance [H]:
// L di/dt = V - R i - K_w n w - brush drop. With `inductance_h` zero the current is algebraic, (2-33), and
// the derivative of `current_a` is zero.
DriveState derivative(const DriveModel& model, const DriveState& state, double payload_kg,
                      double inductance_h, const std::array<double, 2>& voltage_v);

// Current that flows without inductance, thesis (2-33), brush drop included [A].
std::array<double, 2> algebraic_current(const DriveModel& model, const DriveState& state,
                                        const std::array<double, 2>& voltage_v);

}  // namespace joulecast::dynamics
