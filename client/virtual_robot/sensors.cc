#include "client/virtual_robot/sensors.h"

#include <cmath>

namespace joulecast::virtual_robot {

double quantised(double value, double step) {
  return step > 0 ? step * std::round(value / step) : value;
}

Sensors::Sensors(const SensorSuite& suite, const Imperfections& imperfections, const RobotParameters& robot,
                 Rng rng)
    : suite_(suite),
      effect_(imperfections),
      motor_voltage_noise_v_(suite.motor_voltage_noise * robot.nominal_voltage_v),
      motor_current_noise_a_(suite.motor_current_noise_a + suite.motor_current_noise * robot.current_limit_a),
      rng_(rng),
      gyro_bias_rad_s_(suite.noise ? suite.gyro_bias_rad_s * rng_.normal() : 0) {}

Reading Sensors::systematic(Reading r) const {
  for (std::size_t s : {0u, 1u}) {
    r.motor_voltage_v[s] *= 1 + effect_.voltage_sensor_gain;
    r.motor_current_a[s] =
        r.motor_current_a[s] * (1 + effect_.current_sensor_gain) + effect_.current_sensor_bias;
  }
  r.battery_voltage_v *= 1 + effect_.voltage_sensor_gain;
  r.battery_current_a = r.battery_current_a * (1 + effect_.current_sensor_gain) + effect_.current_sensor_bias;
  return r;
}

telemetry::Sample Sensors::sample(const Reading& truth) {
  const Reading r = systematic(truth);
  telemetry::Sample out;
  for (std::size_t s : {0u, 1u}) {
    const double speed = r.wheel_speed_rad_s[s] + noise(suite_.encoder_noise_rad_s);
    out.wheel_velocity_rad_s[s] = suite_.noise ? quantised(speed, suite_.encoder_step_rad_s) : speed;
    if (suite_.motor_channels) {
      out.motor_voltage_v[s] = r.motor_voltage_v[s] + noise(motor_voltage_noise_v_);
      out.motor_current_a[s] = r.motor_current_a[s] + noise(motor_current_noise_a_);
    }
    if (suite_.temperature) out.motor_temperature_c[s] = r.winding_c[s] + noise(suite_.temperature_noise_k);
    out.velocity_command[s] = r.command[s];
  }
  out.battery_voltage_v = r.battery_voltage_v + noise(suite_.battery_voltage_noise_v);
  out.battery_current_a = r.battery_current_a + noise(suite_.battery_current_noise_a);
  if (suite_.gyro) out.yaw_rate_rad_s = r.yaw_rate_rad_s + gyro_bias_rad_s_ + noise(suite_.gyro_noise_rad_s);
  if (suite_.pitch) out.pitch_rad = r.pitch_rad + noise(suite_.pitch_noise_rad);
  if (suite_.pose) {
    out.pose = {r.pose[0] + noise(suite_.pose_noise_m), r.pose[1] + noise(suite_.pose_noise_m),
                r.pose[2] + noise(suite_.heading_noise_rad)};
  }
  if (suite_.payload) out.payload_kg = r.declared_payload_kg;
  return out;
}

}  // namespace joulecast::virtual_robot
