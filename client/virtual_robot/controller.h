#pragma once

#include <array>

#include "client/virtual_robot/robot_parameters.h"

namespace joulecast::virtual_robot {

// The pilot's command: body speeds and their rates.
struct BodyCommand {
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double acceleration_m_s2 = 0;
  double yaw_acceleration_rad_s2 = 0;
};

// How a drive is tuned.
struct ControllerTuning {
  double natural_rad_s = 7;  // of the closed speed loop, critically damped
  double feed_forward = 1;   // share of the model's voltage that is applied ahead of any error
};

// Wheel speed control as robots have it: feed-forward from the robot file's parameters, PI on the encoder
// speed, current limit, battery limit with anti-windup. Has no access to the plant's imperfections.
class SpeedController {
 public:
  static constexpr double period_s = 0.005;

  explicit SpeedController(const RobotParameters& robot, const ControllerTuning& tuning = {});

  void set_payload(double declared_kg);
  // Armature voltages for the next period.
  std::array<double, 2> update(const BodyCommand& command, const std::array<double, 2>& encoder_rad_s,
                               double battery_voltage_v);

 private:
  RobotParameters robot_;
  ControllerTuning tuning_;
  double torque_per_a_;
  double emf_per_rad_s_;
  double straight_inertia_ = 0;  // at one wheel, both with the same acceleration
  double turning_inertia_ = 0;   // at one wheel, both accelerating oppositely
  double proportional_v_s_ = 0;
  double integral_v_ = 0;
  std::array<double, 2> trim_v_{};
};

}  // namespace joulecast::virtual_robot
