#include "gap/runs/run_energy.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {
namespace {

constexpr int steps_a_phase = 160;
constexpr double ramp = 0.1;  // of the arc's length, at each of its ends

struct Bend {
  double curvature = 0, slope = 0;  // 1/m, 1/m^2
};

Bend bend_at(const RunConditions& run, double s) {
  if (run.turn_rad == 0) return {};
  const double length = std::fabs(run.turn_rad) * run.turn_radius_m;
  const double u = (s - 0.5 * (run.distance_m - length)) / length;
  if (u <= 0 || u >= 1) return {};
  const double top = run.turn_rad / (length * (1 - ramp));
  if (u < ramp) return {top * u / ramp, top / (ramp * length)};
  if (u > 1 - ramp) return {top * (1 - u) / ramp, -top / (ramp * length)};
  return {top, 0};
}

class Integral {
 public:
  Integral(const dynamics::DriveModel& model, const RunConditions& run, double turning_factor)
      : model_(model),
        run_(run),
        turning_factor_(turning_factor),
        climb_rad_(std::asin(std::clamp(run.climb_m / run.distance_m, -1.0, 1.0))) {}

  void drive(double duration_s, double speed, double acceleration) {
    const double step = duration_s / steps_a_phase;
    for (int k = 0; k < steps_a_phase; ++k) {
      const double t = (k + 0.5) * step;
      add(step, s_ + (speed + 0.5 * acceleration * t) * t, speed + acceleration * t, acceleration);
    }
    s_ += (speed + 0.5 * acceleration * duration_s) * duration_s;
    energy_.duration_s += duration_s;
  }
  void stand(double duration_s) {
    energy_.battery_j +=
        duration_s * model_.metered_battery_power(model_.battery_power_for({0, 0}), dynamics::unknown);
    energy_.duration_s += duration_s;
  }
  const RunEnergy& energy() const { return energy_; }

 private:
  void add(double step, double s, double speed, double acceleration) {
    const auto& p = model_.parameters();
    const Bend bend = bend_at(run_, s);
    const double yaw = turning_factor_ * bend.curvature * speed;
    const double yaw_acceleration =
        turning_factor_ * (bend.curvature * acceleration + bend.slope * speed * speed);
    dynamics::Instant at;
    at.wheel_speed_rad_s = dynamics::wheels_of_body(p, speed, yaw);
    at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(p, acceleration, yaw_acceleration);
    at.payload_kg = run_.payload_kg;
    at.climb_rad = climb_rad_;
    at.copper_heat_w = heat_w_;
    const dynamics::PowerFlow<double> flow = model_.flow(at);
    for (std::size_t side : {0u, 1u}) {
      const double volts = (1 + p.motor_voltage.gain) * flow.voltage_v[side] + p.motor_voltage.bias;
      const double amperes = (1 + p.motor_current.gain) * flow.current_a[side] + p.motor_current.bias;
      energy_.motor_j[side] += step * volts * amperes;
      const double copper = model_.resistance(side, at) * flow.current_a[side] * flow.current_a[side];
      heat_w_[side] += (copper - heat_w_[side]) * (1 - std::exp(-step / p.thermal_time_constant_s));
    }
    energy_.battery_j += step * model_.metered_battery_power(flow.battery_power_w, dynamics::unknown);
  }

  const dynamics::DriveModel& model_;
  const RunConditions& run_;
  double turning_factor_;
  double climb_rad_;  // NaN: not known
  double s_ = 0;
  std::array<double, 2> heat_w_{};
  RunEnergy energy_;
};

}  // namespace

RunEnergy run_energy(const dynamics::DriveModel& model, const RunConditions& run, double turning_factor) {
  const double top = std::min(run.speed_m_s, std::sqrt(run.acceleration_m_s2 * run.distance_m));
  const double rise_s = top / run.acceleration_m_s2;
  Integral integral(model, run, turning_factor);
  integral.drive(rise_s, 0, run.acceleration_m_s2);
  const double cruise_s = run.distance_m / top - rise_s;
  if (cruise_s > 0) integral.drive(cruise_s, top, 0);
  integral.drive(rise_s, top, -run.acceleration_m_s2);
  if (run.standstill_s > 0) integral.stand(run.standstill_s);
  return integral.energy();
}

}  // namespace joulecast::gap
