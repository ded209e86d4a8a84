#include "planning/line.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include "base/try.h"
#include "planning/numerics.h"

namespace joulecast::planning {
namespace {

// Below this k T, sums of exponentials are replaced by their series in time.
constexpr double series_below = 0.05;

// tanh(x/2)/x, 1/2 at zero.
double half_tanh(double x) {
  return x < 1e-4 ? 0.5 - x * x / 24 : std::tanh(x / 2) / x;
}

// (x - 2 tanh(x/2))/x^3, 1/12 at zero.
double bulge(double x) {
  if (x > 0.3) return (x - 2 * std::tanh(x / 2)) / (x * x * x);
  const double y = x * x;
  return 1.0 / 12 - y * (1.0 / 120 - y * (17.0 / 20160 - y * (31.0 / 362880 - y * (691.0 / 79833600))));
}

// x/sinh(x) and x coth(x), 1 at zero.
double over_sinh(double x) {
  return x < 1e-6 ? 1 - x * x / 6 : -2 * x * std::exp(-x) / std::expm1(-2 * x);
}
double times_coth(double x) {
  return x < 1e-6 ? 1 + x * x / 3 : x / std::tanh(x);
}

double thrust_of(const LineTask& task, double rate, double duration) {
  const double x = rate * duration;
  return (task.distance - (task.start_speed + task.end_speed) * duration * half_tanh(x)) /
         (duration * duration * duration * bulge(x));
}

double start_acceleration_of(const LineTask& task, double rate, double thrust, double duration) {
  const double x = rate * duration;
  return thrust * duration * half_tanh(x) +
         (task.end_speed * over_sinh(x) - task.start_speed * times_coth(x)) / duration;
}

// dE/dT + value of time along the family of extremals; one exponential an evaluation, for the root finder's
// sake.
double slope_of(const LineTask& task, double rate, double duration) {
  const double x = rate * duration, v0 = task.start_speed, v1 = task.end_speed;
  double thrust = 0, a = 0;
  if (x > 0.3) {
    const double e = std::exp(-x), h = (1 - e) / (1 + e);
    thrust = (task.distance - (v0 + v1) * h / rate) * rate * rate / (duration - 2 * h / rate);
    a = thrust * h / rate + rate * (2 * e * v1 - (1 + e * e) * v0) / ((1 - e) * (1 + e));
  } else {
    thrust = thrust_of(task, rate, duration);
    a = start_acceleration_of(task, rate, thrust, duration);
  }
  return task.power.c0 + task.value_of_time_w +
         task.power.c1 * (rate * rate * v0 * v0 - a * a - 2 * thrust * v0);
}

// From rest to rest, transversality reads x = tanh(x/2) (2 + k^2 D sqrt(c1/price)), x = k T. The difference
// of its sides is convex and positive at `above`, so that Newton's method falls onto the root from there.
double time_from_rest(double rate, double swing, double above) {
  const double m = 2 + rate * rate * swing;
  double x = std::min(m, above * rate);
  for (int k = 0; k < 50; ++k) {
    const double e = std::exp(-x), h = (1 - e) / (1 + e);
    const double step = (x - m * h) / (1 - 0.5 * m * (1 - h) * (1 + h));
    x -= step;
    if (std::fabs(step) < 1e-7 * x) break;  // quadratic: the next one would be below 1e-14
  }
  return x / rate;
}

Result<void> validate(const LineTask& task) {
  const auto number = [](double x) { return std::to_string(x); };
  if (!(std::isfinite(task.distance) && task.distance > 0)) {
    return invalid("distance", "is " + number(task.distance) + ", must be positive and finite");
  }
  if (!(std::isfinite(task.start_speed) && task.start_speed >= 0)) {
    return invalid("start_speed", "is " + number(task.start_speed) + ", must not be negative");
  }
  if (!(std::isfinite(task.end_speed) && task.end_speed >= 0)) {
    return invalid("end_speed", "is " + number(task.end_speed) + ", must not be negative");
  }
  if (!(task.power.c1 > 0 && task.power.c2 >= 0)) {
    return invalid("power", "needs c1 > 0 (losses grow with acceleration) and c2 >= 0");
  }
  return {};
}

}  // namespace

LineProfile::LineProfile(const LineTask& task, double duration_s)
    : power_(task.power),
      value_of_time_(task.value_of_time_w),
      distance_(task.distance),
      start_(task.start_speed),
      end_(task.end_speed),
      duration_(duration_s),
      rate_(std::sqrt(task.power.c2 / task.power.c1)),
      left_(std::exp(-rate_ * duration_s)),
      less_twice_(std::expm1(-2 * rate_ * duration_s)),
      thrust_(thrust_of(task, rate_, duration_s)),
      start_acceleration_(start_acceleration_of(task, rate_, thrust_, duration_s)) {
  assert(duration_s > 0);
  const double x = rate_ * duration_;
  end_acceleration_ =
      -thrust_ * duration_ * half_tanh(x) + (end_ * times_coth(x) - start_ * over_sinh(x)) / duration_;
}

LineState LineProfile::state(double t) const {
  const double x = rate_ * duration_, a = rate_ * t, b = rate_ * (duration_ - t), square = rate_ * rate_;
  LineState s;
  if (x < series_below) {
    const double y = a * a;
    const double bend = t * t / 2 * (1 + y / 12 * (1 + y / 30));       // (cosh a - 1)/k^2
    const double cubic = t * t * t / 6 * (1 + y / 20 * (1 + y / 42));  // (sinh a - a)/k^3
    const double jerk = square * start_ - thrust_;
    s.speed = start_ + start_acceleration_ * (t + square * cubic) + jerk * bend;
    s.acceleration = start_acceleration_ * (1 + square * bend) + jerk * (t + square * cubic);
    s.position = start_ * t + start_acceleration_ * bend + jerk * cubic;
    return s;
  }
  const double less_a = std::expm1(-a), less_b = std::expm1(-b), left_a = 1 + less_a, left_b = 1 + less_b;
  // sinh(a)/sinh(x), sinh(b)/sinh(x) and their slopes; 1 - cosh(x/2 - a)/cosh(x/2) and its slope.
  const double rise = left_b * less_a * (2 + less_a) / less_twice_,
               fall = left_a * less_b * (2 + less_b) / less_twice_;
  const double hump = less_a * less_b / (1 + left_);
  const double rising = -rate_ * left_b * (1 + left_a * left_a) / less_twice_,
               falling = rate_ * left_a * (1 + left_b * left_b) / less_twice_;
  const double humping = rate_ * (left_a - left_b) / (1 + left_);
  s.speed = thrust_ / square * hump + start_ * fall + end_ * rise;
  s.acceleration = thrust_ / square * humping + start_ * falling + end_ * rising;
  s.position = (s.acceleration - start_acceleration_ + thrust_ * t) / square;
  return s;
}

double LineProfile::energy_j() const {
  const double core =
      power_.c1 * (end_ * end_acceleration_ - start_ * start_acceleration_ + thrust_ * distance_);
  return core + (power_.cx / 2 * (end_ + start_) + power_.ca) * (end_ - start_) + power_.c3 * distance_ +
         power_.c0 * duration_;
}

double LineProfile::invariant() const {
  return rate_ * rate_ * start_ * start_ - start_acceleration_ * start_acceleration_ - 2 * thrust_ * start_;
}

double LineProfile::peak_speed() const {
  if (!(start_acceleration_ > 0 && end_acceleration_ < 0)) return std::max(start_, end_);
  const double h = invariant();
  return -h / (thrust_ + std::sqrt(std::max(0.0, thrust_ * thrust_ + rate_ * rate_ * h)));
}

double LineProfile::lowest_speed() const {
  if (!(start_acceleration_ < 0 && end_acceleration_ > 0)) return std::min(start_, end_);
  const double h = invariant();
  return h / (-thrust_ + std::sqrt(std::max(0.0, thrust_ * thrust_ + rate_ * rate_ * h)));
}

double LineProfile::peak_acceleration() const {
  return std::max(std::fabs(start_acceleration_), std::fabs(end_acceleration_));
}

Result<LineProfile> line_in_free_time(const LineTask& task) {
  TRY(validate(task));
  const double price = task.power.c0 + task.value_of_time_w;
  if (!(price > 0)) {
    return invalid("value_of_time_w", "plus the power at standstill is " + std::to_string(price) +
                                          " W, must be positive for a best end time to exist");
  }
  const double rate = std::sqrt(task.power.c2 / task.power.c1);
  const auto slope = [&](double duration) { return slope_of(task, rate, duration); };
  const double ends = task.start_speed + task.end_speed;
  // From rest a parabola (k = 0) takes D^2 c1 36/T^4 = price; viscosity and end speeds move that, hence the
  // search. Slower than a mean speed of a third of v0 + vf the profile dips towards zero: a second, worse
  // extremal.
  const double dips = ends > 0 ? 3 * task.distance / ends : std::numeric_limits<double>::infinity();
  const double parabola = std::sqrt(6 * task.distance * std::sqrt(task.power.c1 / price));
  const double slowest = parabola * (1 + rate * parabola);
  if (ends == 0 && rate * parabola > 0.05) {
    return LineProfile(task, time_from_rest(rate, task.distance * std::sqrt(task.power.c1 / price), slowest));
  }
  double high = std::min(dips, slowest), f_high = slope(high);
  for (int k = 0; k < 200 && !(f_high > 0); ++k) {
    high = high < dips ? std::min(dips, 1.5 * high) : 1.5 * high;
    f_high = slope(high);
  }
  double low = high / 2, f_low = slope(low);
  while (f_low >= 0) {
    high = low, f_high = f_low;
    f_low = slope(low /= 2);
  }
  return LineProfile(task, zero_between(slope, low, f_low, high, f_high));
}

}  // namespace joulecast::planning
