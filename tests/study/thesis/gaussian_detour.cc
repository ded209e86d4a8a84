#include "tests/study/thesis/gaussian_detour.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "dynamics/drive_model.h"
#include "tests/study/ramp/ramp.h"

namespace joulecast::client::thesis {
namespace {

// Simpson's rule on an even number of panels.
template <class F>
auto integral(F&& f, double low, double high, int panels) {
  const double step = (high - low) / panels;
  auto sum = f(low) + f(high);
  for (int k = 1; k < panels; ++k) sum = sum + (k % 2 == 1 ? 4.0 : 2.0) * f(low + k * step);
  return (step / 3) * sum;
}

constexpr int panels = 2000;

double motor_power(const dynamics::DriveModel& model, const dynamics::Instant& at) {
  const auto flow = model.flow(at);
  return flow.motor_power_w[0] + flow.motor_power_w[1];
}

// The robot without the load of its motors: only the rotors' inertia and friction.
robot::RobotModel without_load(robot::RobotModel robot) {
  robot.mass = {.chassis_kg = 0, .wheel_kg = 0, .yaw_inertia_kg_m2 = 0, .wheel_inertia_kg_m2 = 0};
  return robot;
}

}  // namespace

GaussianDetour::GaussianDetour(double radius_m, double length_m) : radius_(radius_m), chord_(length_m) {
  double low = 0, high = length_m;
  for (int k = 0; k < 60; ++k) {
    chord_ = 0.5 * (low + high);
    (length_over(chord_) < length_m ? low : high) = chord_;
  }
}

GaussianDetour::Slopes GaussianDetour::slopes(double x_m) const {
  const double u = x_m / radius_, bell = std::exp(-u * u / 2);
  return {-u * bell, (u * u - 1) * bell / radius_, (3 * u - u * u * u) * bell / (radius_ * radius_)};
}

double GaussianDetour::length_over(double chord_m) const {
  return integral([&](double x) { return std::hypot(1, slopes(x).first); }, -chord_m / 2, chord_m / 2,
                  panels);
}

DetourEnergy detour_energy(const robot::RobotModel& robot, const GaussianDetour& detour, double duration_s,
                           double ramp_share, double payload_kg) {
  const std::span<const dynamics::ActiveEffect> no_effects;
  const dynamics::DriveModel combined(robot, no_effects), motor(without_load(robot), no_effects);
  planning::LineTask task;
  task.distance = detour.chord_m();
  const planning::RampProfile progress = *planning::ramp_in_time(task, duration_s, ramp_share);
  DetourEnergy result;

  // The robot at x: y' = tan(heading), everything else by the chain rule.
  const auto instant = [&](const planning::LineSample& along, double track_factor, double payload) {
    const auto s = detour.slopes(along.distance - detour.chord_m() / 2);
    const double stretch2 = 1 + s.first * s.first, stretch = std::sqrt(stretch2);
    const double rate = along.speed, change = along.acceleration;
    const double speed = rate * stretch;
    const double acceleration = change * stretch + rate * rate * s.first * s.second / stretch;
    const double yaw = rate * s.second / stretch2;
    const double yaw_change =
        change * s.second / stretch2 +
        rate * rate * (s.third - 2 * s.first * s.second * s.second / stretch2) / stretch2;
    dynamics::Instant at;
    at.wheel_speed_rad_s = dynamics::wheels_of_body(combined.parameters(), speed, track_factor * yaw);
    at.wheel_acceleration_rad_s2 =
        dynamics::wheels_of_body(combined.parameters(), acceleration, track_factor * yaw_change);
    at.payload_kg = payload;
    for (const double a : at.wheel_acceleration_rad_s2)
      if (track_factor == 1)
        result.peak_wheel_acceleration_rad_s2 = std::max(result.peak_wheel_acceleration_rad_s2, std::fabs(a));
    return at;
  };
  // Each span of the trapezoid separately, so that no panel straddles a jump of acceleration.
  const auto energy = [&](const dynamics::DriveModel& model, double track_factor, double payload) {
    double sum = 0, began_m = 0;
    for (const auto& span : progress.spans()) {
      sum += integral(
          [&](double t) {
            planning::LineSample along;
            along.speed = span.start_speed + span.acceleration * t;
            along.acceleration = span.acceleration;
            along.distance = began_m + t * (span.start_speed + along.speed) / 2;
            return motor_power(model, instant(along, track_factor, payload));
          },
          0, span.duration_s, panels);
      began_m += span.duration_s * (span.start_speed + span.acceleration * span.duration_s / 2);
    }
    return sum;
  };
  result.combined_j = energy(combined, 1, payload_kg);
  result.motor_j = energy(motor, 1, 0);
  result.doubled_track_combined_j = energy(combined, 2, payload_kg);
  result.doubled_track_motor_j = energy(motor, 2, 0);
  return result;
}

}  // namespace joulecast::client::thesis
