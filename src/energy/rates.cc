#include "energy/rates.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/units.h"

namespace joulecast::energy {
namespace {

double lerp(double a, double b, double s) {
  return a + s * (b - a);
}

double measured_or_zero(double value) {
  return std::isfinite(value) ? value : 0;
}

// Headings may wrap at +-pi; in between goes the short way.
double lerp_angle(double a, double b, double s) {
  return a + s * std::remainder(b - a, 2 * std::numbers::pi);
}

}  // namespace

void book(std::span<const double, account::count> increment, signals::Accounts& a) {
  a.battery_j += increment[account::battery];
  a.measured_j += increment[account::measured];
  a.modelled_j += increment[account::modelled];
  for (std::size_t s : {0u, 1u}) {
    a.measured_motor_j[s] += increment[account::measured_motor + s];
    a.modelled_motor_j[s] += increment[account::modelled_motor + s];
  }
  a.drawn_j += increment[account::drawn];
  a.returned_j += increment[account::returned];
  a.charge_ah += increment[account::charge_a] / seconds_per_hour;
  a.distance_m += increment[account::distance];
  a.turned_rad += increment[account::turned];
  for (std::size_t k = 0; k < signals::term_count; ++k) a.ledger.value[k] += increment[account::ledger + k];
}

Reading reading_of(const signals::Sample& sample, const std::array<double, 2>& wheel_acceleration_rad_s2,
                   double payload_kg, double climb_rad, const std::array<double, 2>& copper_heat_w) {
  Reading r;
  r.motion.wheel_speed_rad_s = sample.wheel_velocity_rad_s;
  r.motion.wheel_acceleration_rad_s2 = wheel_acceleration_rad_s2;
  r.motion.payload_kg = payload_kg;
  r.motion.x_m = sample.pose[0];
  r.motion.y_m = sample.pose[1];
  r.motion.heading_rad = sample.pose[2];
  r.motion.climb_rad = climb_rad;
  r.motion.copper_heat_w = copper_heat_w;
  for (std::size_t s : {0u, 1u}) {
    r.motor_voltage_v[s] = measured_or_zero(sample.motor_voltage_v[s]);
    r.motor_current_a[s] = measured_or_zero(sample.motor_current_a[s]);
  }
  r.battery_voltage_v = measured_or_zero(sample.battery_voltage_v);
  r.battery_current_a = measured_or_zero(sample.battery_current_a);
  return r;
}

Reading between(const Reading& a, const Reading& b, double s) {
  Reading r;
  for (std::size_t k : {0u, 1u}) {
    r.motion.wheel_speed_rad_s[k] = lerp(a.motion.wheel_speed_rad_s[k], b.motion.wheel_speed_rad_s[k], s);
    r.motion.wheel_acceleration_rad_s2[k] =
        lerp(a.motion.wheel_acceleration_rad_s2[k], b.motion.wheel_acceleration_rad_s2[k], s);
    r.motion.copper_heat_w[k] = lerp(a.motion.copper_heat_w[k], b.motion.copper_heat_w[k], s);
    r.motor_voltage_v[k] = lerp(a.motor_voltage_v[k], b.motor_voltage_v[k], s);
    r.motor_current_a[k] = lerp(a.motor_current_a[k], b.motor_current_a[k], s);
  }
  r.motion.payload_kg = b.motion.payload_kg;
  r.motion.x_m = lerp(a.motion.x_m, b.motion.x_m, s);
  r.motion.y_m = lerp(a.motion.y_m, b.motion.y_m, s);
  r.motion.heading_rad = lerp_angle(a.motion.heading_rad, b.motion.heading_rad, s);
  r.motion.climb_rad = lerp(a.motion.climb_rad, b.motion.climb_rad, s);
  r.battery_voltage_v = lerp(a.battery_voltage_v, b.battery_voltage_v, s);
  r.battery_current_a = lerp(a.battery_current_a, b.battery_current_a, s);
  return r;
}

Rates rates_at(const dynamics::DriveModel& model, const Reading& reading, Coverage coverage,
               std::array<double, 2>& copper_w) {
  const dynamics::PowerFlow<double> flow = model.flow(reading.motion);
  const double volts = coverage.battery ? reading.battery_voltage_v : dynamics::unknown;
  const double modelled = model.metered_battery_power(flow.battery_power_w, volts);
  const double measured = reading.battery_voltage_v * reading.battery_current_a;
  const double battery = coverage.battery ? measured : modelled;

  Rates r{};
  r[account::battery] = battery;
  r[account::measured] = coverage.battery ? measured : 0;
  r[account::modelled] = modelled;
  for (std::size_t s : {0u, 1u}) {
    r[account::measured_motor + s] =
        coverage.motors ? reading.motor_voltage_v[s] * reading.motor_current_a[s] : 0;
    r[account::modelled_motor + s] = flow.motor_power_w[s];
  }
  r[account::drawn] = std::max(battery, 0.0);
  r[account::returned] = std::max(-battery, 0.0);
  r[account::charge_a] =
      coverage.battery ? reading.battery_current_a : modelled / model.parameters().battery_voltage_v;
  const dynamics::Body<double> body = dynamics::body_of_wheels(
      model.parameters(), reading.motion.wheel_speed_rad_s, reading.motion.wheel_acceleration_rad_s2);
  r[account::distance] = std::fabs(body.speed_m_s);
  r[account::turned] = std::fabs(body.yaw_rate_rad_s);

  signals::Ledger ledger = flow.ledger;
  ledger[signals::Term::sensor] = modelled - flow.battery_power_w;
  ledger[signals::Term::unexplained] = coverage.battery ? measured - modelled : 0;
  std::ranges::copy(ledger.value, r.begin() + account::ledger);
  for (std::size_t s : {0u, 1u})
    copper_w[s] = model.resistance(s, reading.motion) * flow.current_a[s] * flow.current_a[s];
  return r;
}

}  // namespace joulecast::energy
