#pragma once

#include <array>
#include <cstddef>

#include "client/virtual_robot/mission_script.h"
#include "client/virtual_robot/robot_parameters.h"

namespace joulecast::virtual_robot {

// Distance travelled by ramps of one mean acceleration and a cruise; starts and ends at rest. Smooth ramps
// are half waves of a cosine, without the jerk of straight ones.
class Trapezoid {
 public:
  Trapezoid() = default;
  Trapezoid(double distance, double speed, double acceleration, bool smooth = false);

  double duration_s() const { return duration_s_; }
  double speed(double time_s) const;
  double acceleration(double time_s) const;

 private:
  double speed_ = 0, acceleration_ = 0, ramp_s_ = 0, duration_s_ = 0;
  bool smooth_ = false;
};

// The pilot's command: body speeds and their rates.
struct BodyCommand {
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double acceleration_m_s2 = 0;
  double yaw_acceleration_rad_s2 = 0;
};

// Drives a script: each leg is aimed from where the robot truly is when the leg begins (it localises itself),
// so errors of wheels and track do not grow over a mission.
class Pilot {
 public:
  // `settle_s`: at rest between legs.
  Pilot(const RobotParameters& robot, bool smooth_ramps, double settle_s)
      : robot_(robot), smooth_ramps_(smooth_ramps), settle_s_(settle_s) {}

  void begin(MissionScript script);
  bool done() const { return leg_ >= script_.legs.size(); }
  double payload_kg() const { return payload_kg_; }

  // The command for the next control period.
  BodyCommand update(double x_m, double y_m, double heading_rad);

 private:
  void begin_leg(double x_m, double y_m, double heading_rad);
  BodyCommand follow(double x_m, double y_m, double heading_rad) const;

  RobotParameters robot_;
  bool smooth_ramps_;
  double settle_s_;
  MissionScript script_;
  std::size_t leg_ = 0;
  bool begun_ = false;
  double time_s_ = 0;      // since the leg began
  double duration_s_ = 0;  // of the leg, settling included
  double payload_kg_ = 0;
  Trapezoid profile_;
  double turn_sign_ = 1;
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
