#include "energy/motion_estimate.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/try.h"
#include "dynamics/climb.h"
#include "energy/integrators.h"
#include "energy/rates.h"

namespace joulecast::energy {
namespace {

constexpr std::size_t pose_index = account::count;         // x, y, heading
constexpr std::size_t motion_heat_index = pose_index + 3;  // two
constexpr std::size_t motion_state_size = motion_heat_index + 2;
constexpr double tolerance = 1e-8;
constexpr double least_span_s = 1e-9;
constexpr double finest_floor_m = 0.05;  // regions of the floor are resolved to this length

// One span of constant acceleration, in time since its beginning.
class MotionSpan final : public InitialValueProblem {
 public:
  MotionSpan(const dynamics::DriveModel& model, double payload_kg, bool pose_known)
      : model_(model), payload_kg_(payload_kg), pose_known_(pose_known) {}

  void begin(const MotionPoint& a, const MotionPoint& b, const std::array<double, 2>& climb_rad) {
    a_ = a;
    climb_rad_ = climb_rad;
    duration_s_ = b.time_s - a.time_s;
    acceleration_ = (b.speed_m_s - a.speed_m_s) / duration_s_;
    yaw_acceleration_ = (b.yaw_rate_rad_s - a.yaw_rate_rad_s) / duration_s_;
    wheel_acceleration_ = dynamics::wheels_of_body(model_.parameters(), acceleration_, yaw_acceleration_);
    const double power = std::max(std::fabs(now(0, {}).front()), model_.parameters().idle_power_w);
    scale_ = 1 / (tolerance * std::max(1.0, power) * duration_s_);
  }

  void rate(double t, std::span<const double> state, std::span<double> out) override {
    const double speed = a_.speed_m_s + acceleration_ * t,
                 yaw_rate = a_.yaw_rate_rad_s + yaw_acceleration_ * t;
    std::array<double, 2> copper{};
    const Rates rates = now(t, state, &copper);
    std::ranges::copy(rates, out.begin());
    out[pose_index] = speed * std::cos(state[pose_index + 2]);
    out[pose_index + 1] = speed * std::sin(state[pose_index + 2]);
    out[pose_index + 2] = yaw_rate;
    for (std::size_t s : {0u, 1u})
      out[motion_heat_index + s] =
          (copper[s] - state[motion_heat_index + s]) / model_.parameters().thermal_time_constant_s;
  }

  void weights(std::span<const double>, std::span<double> weight) const override {
    std::ranges::fill(weight, scale_);
    for (std::size_t k = pose_index; k < motion_state_size; ++k) weight[k] = 1e6;
  }

 private:
  Rates now(double t, std::span<const double> state, std::array<double, 2>* copper_w = nullptr) const {
    Reading reading;
    reading.motion.wheel_speed_rad_s = dynamics::wheels_of_body(
        model_.parameters(), a_.speed_m_s + acceleration_ * t, a_.yaw_rate_rad_s + yaw_acceleration_ * t);
    reading.motion.wheel_acceleration_rad_s2 = wheel_acceleration_;
    reading.motion.payload_kg = payload_kg_;
    reading.motion.climb_rad = climb_rad_[0] + (climb_rad_[1] - climb_rad_[0]) * t / duration_s_;
    if (!state.empty()) {
      if (pose_known_) {
        reading.motion.x_m = state[pose_index];
        reading.motion.y_m = state[pose_index + 1];
        reading.motion.heading_rad = state[pose_index + 2];
      }
      reading.motion.copper_heat_w = {state[motion_heat_index], state[motion_heat_index + 1]};
    }
    std::array<double, 2> copper{};
    const Rates rates = rates_at(model_, reading, {}, copper);
    if (copper_w != nullptr) *copper_w = copper;
    return rates;
  }

  const dynamics::DriveModel& model_;
  double payload_kg_;
  bool pose_known_;
  MotionPoint a_;
  std::array<double, 2> climb_rad_{};
  double duration_s_ = 0, acceleration_ = 0, yaw_acceleration_ = 0, scale_ = 1;
  std::array<double, 2> wheel_acceleration_{};
};

}  // namespace

Result<std::array<double, 2>> climb_of_span(const MotionPoint& a, const MotionPoint& b) {
  const double rise = b.height_m - a.height_m;
  if (std::isnan(rise)) return std::array{a.climb_rad, b.climb_rad};
  const double way = 0.5 * (a.speed_m_s + b.speed_m_s) * (b.time_s - a.time_s);
  if (rise == 0) return std::array{0.0, 0.0};
  const double climb = dynamics::climb_over(rise, way);
  if (std::isnan(climb))
    return invalid("height_m", "changes by " + std::to_string(rise) + " m over " + std::to_string(way) +
                                   " m of way, steeper than 45 degrees");
  return std::array{climb, climb};
}

Result<signals::Accounts> estimate_motion(const dynamics::DriveModel& model,
                                          std::span<const MotionPoint> points, double payload_kg,
                                          const std::optional<StartPose>& start) {
  if (points.size() < 2) return invalid("time_s", "must have at least 2 points");
  MotionSpan span(model, payload_kg, start.has_value());
  Cvode cvode(motion_state_size, span);
  const std::span<double> y = cvode.state();
  if (start) {
    y[pose_index] = start->x_m;
    y[pose_index + 1] = start->y_m;
    y[pose_index + 2] = start->heading_rad;
  }
  for (std::size_t k = 1; k < points.size(); ++k) {
    const double duration = points[k].time_s - points[k - 1].time_s;
    const bool repeated = duration == 0 && points[k].speed_m_s == points[k - 1].speed_m_s &&
                          points[k].yaw_rate_rad_s == points[k - 1].yaw_rate_rad_s;
    if (!(duration >= least_span_s) && !repeated)
      return invalid("time_s/" + std::to_string(k),
                     "must be later than the one before, by 1e-9 s at least, or repeat its point");
    const auto climb = climb_of_span(points[k - 1], points[k]);
    if (!climb) return invalid("height_m/" + std::to_string(k), climb.error().message);
    if (repeated) continue;
    span.begin(points[k - 1], points[k], *climb);
    const double fastest = std::max(std::fabs(points[k].speed_m_s), std::fabs(points[k - 1].speed_m_s));
    cvode.limit_step(start && fastest > 0 ? finest_floor_m / fastest : 0);
    TRY(cvode.advance(0, duration));
  }

  if (points.front().time_s == points.back().time_s) return invalid("time_s", "must last longer than 0 s");
  signals::Accounts a;
  book(y.first<account::count>(), a);
  a.duration_s = points.back().time_s - points.front().time_s;
  return a;
}

}  // namespace joulecast::energy
