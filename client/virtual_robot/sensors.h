#pragma once

#include <array>

#include "client/virtual_robot/imperfections.h"
#include "client/virtual_robot/rng.h"
#include "client/virtual_robot/robot_parameters.h"
#include "signals/sample.h"

namespace joulecast::virtual_robot {

// The robot's sensors and their accuracy. Standard deviations are of white noise.
struct SensorSuite {
  bool motor_channels = true;
  bool gyro = true;
  bool pose = true;
  bool temperature = false;
  bool pitch = false;
  bool payload = true;

  double encoder_step_rad_s = 0.005;
  double encoder_noise_rad_s = 0.010;
  double motor_voltage_noise = 0.003;    // of the battery's nominal voltage
  double motor_current_noise_a = 0.020;  // plus
  double motor_current_noise = 0.0018;   // of the current limit
  double battery_voltage_noise_v = 0.020;
  double battery_current_noise_a = 0.050;
  double motor_current_step_a = 0;  // of the converter
  double battery_current_step_a = 0;
  double voltage_step_v = 0;   // of motors and battery
  double current_drift_a = 0;  // amplitude of a slow drift of the currents' zero, per sensor
  double gyro_noise_rad_s = 0.004;
  double gyro_bias_rad_s = 0.002;  // standard deviation between robots
  double pose_noise_m = 0.010;
  double heading_noise_rad = 0.010;
  double temperature_noise_k = 0.4;
  double pitch_noise_rad = 0.003;
  double covariates_hz = 0;  // how often cpu_load and height_m are published; 0: not
  double height_noise_m = 0.01;
  double height_step_m = 0;  // of the height as published

  double sampling_jitter = 0.0;   // of the sampling period, uniform to either side
  double loss_probability = 0.0;  // of a sample that never reaches the network
  bool noise = true;              // false: systematic errors only
};

struct Electrical {
  std::array<double, 2> motor_voltage_v{};
  std::array<double, 2> motor_current_a{};
  double battery_voltage_v = 0;
  double battery_current_a = 0;
};

// The quantities as they are, before any sensor.
struct Reading : Electrical {
  std::array<double, 2> wheel_speed_rad_s{};
  std::array<double, 2> command{};
  double yaw_rate_rad_s = 0;
  double pitch_rad = 0;
  std::array<double, 3> pose{};
  std::array<double, 2> winding_c{};
  double declared_payload_kg = 0;
  double time_s = 0;  // since the robot was made
};

[[nodiscard]] double quantised(double value, double step);

class Sensors {
 public:
  Sensors(const SensorSuite& suite, const Imperfections& imperfections, const World& world,
          const RobotParameters& robot, Rng rng);

  // The reading with gains and biases of the electrical sensors, without noise.
  Reading systematic(Reading truth) const;
  // A sample without its clock: systematic errors, noise, quantisation, missing channels as NaN.
  signals::Sample sample(const Reading& truth);

  Rng& rng() { return rng_; }

 private:
  double drift_a(std::size_t sensor, double time_s) const;
  double read(double value, double deviation, double step);
  double noise(double deviation) { return suite_.noise ? deviation * rng_.normal() : 0; }

  SensorSuite suite_;
  Imperfections effect_;
  World world_;
  double motor_voltage_noise_v_;
  double motor_current_noise_a_;
  Rng rng_;
  double gyro_bias_rad_s_;
  std::array<double, 3> drift_phase_{};  // right, left, battery
};

}  // namespace joulecast::virtual_robot
