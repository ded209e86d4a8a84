#include "planning/limited_line.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "planning/numerics.h"

namespace joulecast::planning {
namespace {

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

}  // namespace

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

namespace {

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
