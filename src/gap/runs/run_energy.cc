#include "gap/runs/run_energy.h"

#include <algorithm>
#include <cmath>

#include "gap/equations/channels.h"

namespace joulecast::gap {
namespace {

// Steps of the acceleration and of the braking, of a straight way between them (the windings warm up), and of
// one with an arc. A power of second order in time is off by 1/(4 n^2) of itself.
constexpr int ramp_steps = 24, straight_steps = 4, arc_steps = 40;
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

class Drive {
 public:
  Drive(const dynamics::DriveModel& model, const RunConditions& run)
      : model_(model),
        run_(run),
        climb_rad_(std::asin(std::clamp(run.climb_m / run.distance_m, -1.0, 1.0))) {}

  void move(double duration_s, double speed, double acceleration, int steps) {
    const double step_s = duration_s / steps;
    for (int k = 0; k < steps; ++k) {
      const double t = (k + 0.5) * step_s;
      add(step_s, s_ + (speed + 0.5 * acceleration * t) * t, speed + acceleration * t, acceleration);
    }
    s_ += (speed + 0.5 * acceleration * duration_s) * duration_s;
  }
  void stand(double duration_s) {
    instants_.push_back(at_rest(duration_s));
    instants_.back().resting = {true, true};
  }
  std::vector<windows::Window> instants() { return std::move(instants_); }

 private:
  windows::Window at_rest(double step_s) const {
    windows::Window w;
    w.length_s = step_s;
    w.payload_kg = run_.payload_kg;
    w.copper_heat_w = heat_w_;
    return w;
  }

  void add(double step_s, double s, double speed, double acceleration) {
    const Bend bend = bend_at(run_, s);
    const double yaw = bend.curvature * speed;
    const double yaw_acceleration = bend.curvature * acceleration + bend.slope * speed * speed;
    windows::Window w = at_rest(step_s);
    w.speed_rad_s = dynamics::wheels_of_body(model_.parameters(), speed, yaw);
    w.acceleration_rad_s2 = dynamics::wheels_of_body(model_.parameters(), acceleration, yaw_acceleration);
    w.moving = {true, true};
    w.climb_rad = climb_rad_;
    const auto flow = model_.flow(windows::instant_of(w));
    for (std::size_t k = 0; k < heat_w_.size(); ++k) {
      for (const std::size_t side : {0u, 1u}) {
        const double copper =
            model_.resistance(side, windows::instant_of(w)) * flow.current_a[side] * flow.current_a[side];
        heat_w_[k][side] +=
            (copper - heat_w_[k][side]) * (1 - std::exp(-step_s / windows::heat_time_constants_s[k]));
      }
    }
    instants_.push_back(std::move(w));
  }

  const dynamics::DriveModel& model_;
  const RunConditions& run_;
  double climb_rad_;  // NaN: unknown
  double s_ = 0;
  decltype(windows::Window::copper_heat_w) heat_w_{};
  std::vector<windows::Window> instants_;
};

}  // namespace

std::vector<windows::Window> run_instants(const dynamics::DriveModel& model, const RunConditions& run) {
  const double top = std::min(run.speed_m_s, std::sqrt(run.acceleration_m_s2 * run.distance_m));
  const double rise_s = top / run.acceleration_m_s2;
  Drive drive(model, run);
  drive.move(rise_s, 0, run.acceleration_m_s2, ramp_steps);
  const double cruise_s = run.distance_m / top - rise_s;
  if (cruise_s > 0) drive.move(cruise_s, top, 0, run.turn_rad == 0 ? straight_steps : arc_steps);
  drive.move(rise_s, top, -run.acceleration_m_s2, ramp_steps);
  if (run.standstill_s > 0) drive.stand(run.standstill_s);
  return drive.instants();
}

RunEnergy run_energy(const dynamics::DriveModel& model, const RunConditions& run) {
  RunEnergy energy;
  for (const windows::Window& w : run_instants(model, run)) {
    const MeteredPower<double> power = metered_powers(model, w);
    for (const std::size_t side : {0u, 1u}) energy.motor_j[side] += w.length_s * power.motor_w[side];
    energy.battery_j += w.length_s * power.battery_w;
    energy.duration_s += w.length_s;
  }
  return energy;
}

}  // namespace joulecast::gap
