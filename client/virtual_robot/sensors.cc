#include "client/virtual_robot/sensors.h"

#include <cmath>
#include <numbers>

namespace joulecast::virtual_robot {
namespace {

constexpr double drift_period_s = 180;

}  // namespace

double quantised(double value, double step) {
  return step > 0 ? step * std::round(value / step) : value;
}

Sensors::Sensors(const SensorSuite& suite, const Imperfections& imperfections, const World& world,
                 const RobotParameters& robot, Rng rng)
    : suite_(suite),
      effect_(imperfections),
      world_(world),
      motor_voltage_noise_v_(suite.motor_voltage_noise * robot.nominal_voltage_v),
      motor_current_noise_a_(suite.motor_current_noise_a + suite.motor_current_noise * robot.current_limit_a),
      rng_(rng),
      gyro_bias_rad_s_(suite.noise ? suite.gyro_bias_rad_s * rng_.normal() : 0) {
  if (suite_.current_drift_a == 0) return;
  for (double& phase : drift_phase_) phase = rng_.uniform(0, 2 * std::numbers::pi);
}

double Sensors::drift_a(std::size_t sensor, double time_s) const {
  return suite_.current_drift_a *
         std::sin(2 * std::numbers::pi * time_s / drift_period_s + drift_phase_[sensor]);
}

double Sensors::read(double value, double deviation, double step) {
  const double noisy = value + noise(deviation);
  return suite_.noise ? quantised(noisy, step) : noisy;
}

Reading Sensors::systematic(Reading r) const {
  for (std::size_t s : {0u, 1u}) {
    const double share = world_.motor_sensor_share;
    r.motor_voltage_v[s] *= 1 + share * effect_.voltage_sensor_gain;
    r.motor_current_a[s] = r.motor_current_a[s] * (1 + share * effect_.current_sensor_gain) +
                           share * effect_.current_sensor_bias;
  }
  const double share = world_.battery_sensor_share;
  r.battery_voltage_v *= 1 + share * effect_.voltage_sensor_gain;
  r.battery_current_a =
      r.battery_current_a * (1 + share * effect_.current_sensor_gain) + share * effect_.current_sensor_bias;
  return r;
}

signals::Sample Sensors::sample(const Reading& truth) {
  const Reading r = systematic(truth);
  signals::Sample out;
  for (std::size_t s : {0u, 1u}) {
    out.wheel_velocity_rad_s[s] =
        read(r.wheel_speed_rad_s[s], suite_.encoder_noise_rad_s, suite_.encoder_step_rad_s);
    if (suite_.motor_channels) {
      out.motor_voltage_v[s] = read(r.motor_voltage_v[s], motor_voltage_noise_v_, suite_.voltage_step_v);
      out.motor_current_a[s] = read(r.motor_current_a[s] + drift_a(s, r.time_s), motor_current_noise_a_,
                                    suite_.motor_current_step_a);
    }
    if (suite_.temperature) out.motor_temperature_c[s] = r.winding_c[s] + noise(suite_.temperature_noise_k);
    out.velocity_command[s] = r.command[s];
  }
  out.battery_voltage_v = read(r.battery_voltage_v, suite_.battery_voltage_noise_v, suite_.voltage_step_v);
  out.battery_current_a = read(r.battery_current_a + drift_a(2, r.time_s), suite_.battery_current_noise_a,
                               suite_.battery_current_step_a);
  if (suite_.gyro) out.yaw_rate_rad_s = r.yaw_rate_rad_s + gyro_bias_rad_s_ + noise(suite_.gyro_noise_rad_s);
  if (suite_.pitch) out.pitch_rad = r.pitch_rad + noise(suite_.pitch_noise_rad);
  if (suite_.pose)
    out.pose = {r.pose[0] + noise(suite_.pose_noise_m), r.pose[1] + noise(suite_.pose_noise_m),
                r.pose[2] + noise(suite_.heading_noise_rad)};
  if (suite_.payload) out.payload_kg = r.declared_payload_kg;
  return out;
}

}  // namespace joulecast::virtual_robot
