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

// asinh(x)/x.
double asinh_over(double x) {
  if (x > 0.03) return std::asinh(x) / x;
  const double y = x * x;
  return 1 - y * (1.0 / 6 - y * (3.0 / 40 - y * (15.0 / 336)));
}

// (x sqrt(1 + x^2) - asinh x)/x^3.
double bow(double x) {
  const double y = x * x;
  if (x > 0.05) return (x * std::sqrt(1 + y) - std::asinh(x)) / (x * y);
  return 2.0 / 3 - y * (1.0 / 5 - y * (3.0 / 28 - y * (5.0 / 72)));
}

// From an end speed to the peak: full acceleration up to `join`, the extremal from there.
struct Flank {
  double join = 0;
  double ramp_s = 0, ramp = 0;
  double free_s = 0, free = 0;

  double distance() const { return ramp + free; }
};

// Everything follows from g = A - k^2 v_p, the slope of a^2 at the peak; A = price/(c1 v_p).
class Shape {
 public:
  Shape(const LineTask& task, double acceleration_limit)
      : push_((task.power.c0 + task.value_of_time_w) / task.power.c1),
        square_(task.power.c2 / task.power.c1),
        rate_(std::sqrt(square_)),
        limit_(acceleration_limit) {}

  double peak(double g) const { return 2 * push_ / (g + std::sqrt(g * g + 4 * square_ * push_)); }
  double slope(double peak) const { return push_ / peak - square_ * peak; }
  // Speed of least cost a metre: no extremal in free time is faster. Infinite without viscosity.
  double best_speed() const {
    return square_ > 0 ? std::sqrt(push_ / square_) : std::numeric_limits<double>::infinity();
  }
  double square() const { return square_; }

  Flank flank(double end_speed, double peak, double g) const {
    Flank f;
    f.join = end_speed;
    double y = peak - end_speed;
    if (!(y > 0)) return f;
    if (std::isfinite(limit_)) {
      const double square = limit_ * limit_;
      const double most = 2 * square / (g + std::sqrt(g * g + 4 * square_ * square));
      if (y > most) {
        y = most;
        f.join = peak - most;
        f.ramp_s = (f.join - end_speed) / limit_;
        f.ramp = f.ramp_s * 0.5 * (f.join + end_speed);
      }
    }
    const double root = std::sqrt(y / g), x = rate_ * root;
    f.free_s = 2 * root * asinh_over(x);
    f.free = peak * f.free_s - y * root * bow(x);
    return f;
  }

 private:
  double push_, square_, rate_, limit_;
};

// As many even cells as an extremal needs so that the speed, taken as linear between them, covers its
// distance but for `distance_told`; at least `count`.
double enough_cells(const LineProfile& profile, double count) {
  constexpr double distance_told = 8e-5, most = 20'000;
  const double ends = 0.5 * (profile.speed(0) + profile.speed(profile.duration_s()));
  while (count < most) {
    const double step = profile.duration_s() / count;
    double sum = ends;
    for (double i = 1; i < count; ++i) sum += profile.speed(i * step);
    const double error = std::fabs(sum * step / profile.distance() - 1);
    if (error <= distance_told) break;
    count = std::ceil(count * std::clamp(1.02 * std::sqrt(error / distance_told), 1.02, 4.0));
  }
  return count;
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

LineMotion::Piece& LineMotion::append(double duration_s, double distance, double energy_j) {
  assert(count_ < pieces_.size());
  Piece& piece = pieces_[count_++];
  piece.start_s = duration_;
  piece.start = distance_;
  piece.duration_s = duration_s;
  duration_ += duration_s;
  distance_ += distance;
  energy_ += energy_j;
  return piece;
}

void LineMotion::append_free(const LineProfile& profile) {
  append(profile.duration_s(), profile.distance(), profile.energy_j()).free = profile;
  peak_speed_ = std::max(peak_speed_, profile.peak_speed());
  lowest_speed_ = std::min(lowest_speed_, profile.lowest_speed());
  peak_acceleration_ = std::max(peak_acceleration_, profile.peak_acceleration());
  residual_w_ = std::max(residual_w_, std::fabs(profile.transversality_w()));
  if (multiplier_)
    residual_w_ =
        std::max(residual_w_, std::fabs(*multiplier_ - profile.distance_multiplier()) * profile.peak_speed());
  multiplier_ = profile.distance_multiplier();
}

void LineMotion::append_free(const LineTask& task, double distance, double start_speed, double end_speed,
                             double duration_s) {
  if (!(duration_s > 0)) return;
  LineTask part = task;
  part.distance = distance;
  part.start_speed = start_speed;
  part.end_speed = end_speed;
  append_free(LineProfile(part, duration_s));
}

void LineMotion::append_ramp(double start_speed, double acceleration, double duration_s) {
  if (!(duration_s > 0)) return;
  const double end_speed = start_speed + acceleration * duration_s, middle = 0.5 * (start_speed + end_speed);
  // Power is quadratic in the speed: Simpson's rule is exact.
  const double energy = duration_s / 6 *
                        (power_.power_w(start_speed, acceleration) +
                         4 * power_.power_w(middle, acceleration) + power_.power_w(end_speed, acceleration));
  Piece& piece = append(duration_s, middle * duration_s, energy);
  piece.speed = start_speed;
  piece.acceleration = acceleration;
  peak_speed_ = std::max({peak_speed_, start_speed, end_speed});
  lowest_speed_ = std::min({lowest_speed_, start_speed, end_speed});
  peak_acceleration_ = std::max(peak_acceleration_, std::fabs(acceleration));
  (acceleration == 0 ? holds_speed_ : holds_acceleration_) = true;
}

const LineMotion::Piece& LineMotion::at(double& time_s) const {
  std::size_t k = 0;
  while (k + 1 < count_ && time_s >= pieces_[k + 1].start_s) ++k;
  time_s = std::clamp(time_s - pieces_[k].start_s, 0.0, pieces_[k].duration_s);
  return pieces_[k];
}

std::vector<double> LineMotion::times(std::size_t cells) const {
  std::vector<double> times{0};
  for (std::size_t k = 0; k < count_; ++k) {
    const Piece& piece = pieces_[k];
    const double from = piece.free ? piece.free->speed(0) : piece.speed;
    const double to =
        piece.free ? piece.free->speed(piece.duration_s) : from + piece.acceleration * piece.duration_s;
    const double share = std::max(piece.duration_s / duration_, 0.5 * std::fabs(to - from) / peak_speed_);
    // At constant acceleration a row determines the motion until the next one; a few more show how power
    // changes.
    const double wanted = piece.free ? share : piece.acceleration != 0 ? 0.25 * share : 0;
    double count = std::max(1.0, std::ceil(static_cast<double>(cells) * wanted));
    if (piece.free) count = enough_cells(*piece.free, count);
    for (double i = 1; i <= count; ++i) times.push_back(piece.start_s + piece.duration_s * i / count);
  }
  times.back() = duration_;
  return times;
}

LineState LineMotion::state(double t) const {
  const Piece& piece = at(t);
  if (!piece.free) {
    return {piece.start + (piece.speed + 0.5 * piece.acceleration * t) * t,
            piece.speed + piece.acceleration * t, piece.acceleration};
  }
  LineState s = piece.free->state(t);
  s.position += piece.start;
  return s;
}

std::optional<LineMotion> line_within(const LineTask& task, double speed_limit, double acceleration_limit) {
  const double v0 = task.start_speed, v1 = task.end_speed, fastest_end = std::max(v0, v1);
  if (!(task.power.c1 > 0 && task.power.c2 >= 0 && task.power.c0 + task.value_of_time_w > 0)) return {};
  if (!(fastest_end <= speed_limit)) return {};
  LineMotion motion(task.power);
  if (const auto free = line_in_free_time(task); free && free->peak_speed() <= speed_limit &&
                                                 free->peak_acceleration() <= acceleration_limit &&
                                                 free->lowest_speed() >= 0) {
    motion.append_free(*free);
    return motion;
  }
  const Shape shape(task, acceleration_limit);
  const bool to_limit = speed_limit < shape.best_speed();
  // The peak approaches the speed of least cost as exp(-k T); below this difference it is taken as equal.
  double g = to_limit ? shape.slope(speed_limit) : 1e-13 * shape.square() * shape.best_speed();
  double peak = to_limit ? speed_limit : shape.peak(g);
  if (!(peak > fastest_end)) return {};
  const auto distance = [&](double x) {
    const double slope = std::exp(x), top = shape.peak(slope), first = shape.flank(v0, top, slope).distance();
    return std::log((first + (v0 == v1 ? first : shape.flank(v1, top, slope).distance())) / task.distance);
  };
  Flank up = shape.flank(v0, peak, g), down = v0 == v1 ? up : shape.flank(v1, peak, g);
  double cruise = task.distance - up.distance() - down.distance();
  if (cruise < 0) {
    double low = std::log(g), at_low = std::log(1 - cruise / task.distance), high = low, at_high = at_low;
    if (fastest_end > 0) {
      high = std::log(shape.slope(fastest_end * (1 + 1e-12)));
      at_high = distance(high);
      if (!(at_high < 0)) return {};
    } else {
      // No peak is higher than the triangle's at full acceleration, nor in general much lower.
      const double triangle = std::sqrt(acceleration_limit * task.distance);
      if (triangle < peak) {
        const double x = std::log(shape.slope(triangle));
        if (const double y = distance(x); y > 0) low = x, at_low = y, high = x;
      }
      for (double step = 1; at_high > 0; step *= 2) at_high = distance(high += step);
    }
    const double x =
        zero_between([&](double y) { return -distance(y); }, low, -at_low, high, -at_high, 0, 1e-12);
    g = std::exp(x);
    peak = shape.peak(g);
    up = shape.flank(v0, peak, g), down = shape.flank(v1, peak, g);
    cruise = 0;
  }
  motion.append_ramp(v0, acceleration_limit, up.ramp_s);
  motion.append_free(task, up.free, up.join, peak, up.free_s);
  motion.append_ramp(peak, 0, cruise / peak);
  motion.append_free(task, down.free, peak, down.join, down.free_s);
  motion.append_ramp(down.join, -acceleration_limit, down.ramp_s);
  return motion;
}

LineMotion line_to_peak(const LineTask& task, double peak, double acceleration_limit) {
  LineMotion motion(task.power);
  const Shape shape(task, acceleration_limit);
  const Flank flank = shape.flank(0, peak, shape.slope(peak));
  motion.append_ramp(0, acceleration_limit, flank.ramp_s);
  motion.append_free(task, flank.free, flank.join, peak, flank.free_s);
  motion.append_free(task, flank.free, peak, flank.join, flank.free_s);
  motion.append_ramp(flank.join, -acceleration_limit, flank.ramp_s);
  return motion;
}

double best_speed_of(const LineTask& task) {
  return Shape(task, std::numeric_limits<double>::infinity()).best_speed();
}

double shortest_time_within(const LineTask& task, double speed_limit, double acceleration_limit) {
  const double v0 = task.start_speed, v1 = task.end_speed, a = acceleration_limit;
  if (!std::isfinite(a)) return std::isfinite(speed_limit) ? task.distance / speed_limit : 0;
  double top = std::min(speed_limit, std::sqrt(a * task.distance + 0.5 * (v0 * v0 + v1 * v1)));
  if (!(top >= std::max(v0, v1) * (1 - 1e-9))) return std::numeric_limits<double>::infinity();
  top = std::max({top, v0, v1});
  const double ramps = (2 * top * top - v0 * v0 - v1 * v1) / (2 * a);
  return (2 * top - v0 - v1) / a + std::max(0.0, task.distance - ramps) / top;
}

}  // namespace joulecast::planning
