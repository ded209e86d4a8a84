#include "dynamics/climb.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace joulecast::dynamics {
namespace {

constexpr double shortest_stretch_m = 0.5;
constexpr double stretch_s = 1;
constexpr double slope_of_grain =
    0.01;  // that one usual change of the height may make: as wheels on a hard floor resist
constexpr double standing_m_s = 0.01;  // encoders of a standing robot show less
constexpr double jump_grains = 10;     // usual changes: a larger step than the way explains is the sensor's
constexpr double finest = 1.0 / 64;    // of the reach: heights closer together are averaged
constexpr std::size_t most_knots = 1024;

// To each of so many sides of the robot.
double reach_m(double speed_m_s, double grain_m, int sides) {
  return std::max(
      {shortest_stretch_m / sides, stretch_s * std::fabs(speed_m_s) / sides, grain_m / slope_of_grain});
}

bool stands(const ClimbReading& reading) {
  return !(std::fabs(reading.speed_m_s) >= standing_m_s);
}

int direction_of(const ClimbReading& reading) {
  if (stands(reading)) return 0;
  return reading.speed_m_s > 0 ? 1 : -1;
}

// Way driven between two readings, in either direction.
double way_between(const ClimbReading& a, const ClimbReading& b) {
  if (stands(a) && stands(b)) return 0;
  return 0.5e-6 * static_cast<double>(b.utime_us - a.utime_us) *
         (std::fabs(a.speed_m_s) + std::fabs(b.speed_m_s));
}

double median(std::span<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

double climb_over(double rise_m, double way_m) {
  const double sine = rise_m / way_m;
  return std::fabs(sine) <= std::numbers::sqrt2 / 2 ? std::asin(sine) : unknown;
}

void HeightProfile::clear() {
  knots_.clear();
  last_way_m_ = last_height_m_ = drift_m_ = 0;
}

void HeightProfile::add(double way_m, bool standing, double height_m, double grain_m) {
  const double height = height_m - drift_m_;
  const double change = std::fabs(height - last_height_m_);
  if (knots_.empty()) {
    knots_.push_back({way_m, height});
  } else if (standing || change > (way_m - last_way_m_) + jump_grains * grain_m) {
    drift_m_ += height - last_height_m_;
    last_way_m_ = way_m;
    return;
  } else if (height != last_height_m_) {
    const Knot here{0.5 * (last_way_m_ + way_m), 0.5 * (last_height_m_ + height)};
    Knot& last = knots_.back();
    if (knots_.size() > 1 && here.way_m - last.way_m < finest * reach_m(0, grain_m, 1)) {
      ++last.count;
      last.way_m += (here.way_m - last.way_m) / last.count;
      last.height_m += (here.height_m - last.height_m) / last.count;
    } else {
      knots_.push_back(here);
    }
  }
  last_way_m_ = way_m;
  last_height_m_ = height;
}

void HeightProfile::forget_before(double way_m) {
  const auto first = std::ranges::upper_bound(knots_, way_m, {}, &Knot::way_m);
  // The knot before it is the other end of the line on which it lies.
  std::ptrdiff_t gone = first - knots_.begin() - 1;
  const auto half = static_cast<std::ptrdiff_t>(knots_.size() / 2);
  if (knots_.size() > most_knots) gone = std::max(gone, half);
  if (gone > half / 2) knots_.erase(knots_.begin(), knots_.begin() + gone);  // many at a time
}

double HeightProfile::slope(double from_m, double to_m) const {
  const double middle = 0.5 * (from_m + to_m), length = to_m - from_m;
  double moment = 0;  // of the height about the middle
  const auto add = [&](const Knot& a, const Knot& b) {
    const double x0 = std::max(a.way_m, from_m) - middle, x1 = std::min(b.way_m, to_m) - middle;
    if (!(x1 > x0)) return;
    const double rise = (b.height_m - a.height_m) / (b.way_m - a.way_m);
    const double at_middle = a.height_m + rise * (middle - a.way_m);
    moment += 0.5 * at_middle * (x1 * x1 - x0 * x0) + rise * (x1 * x1 * x1 - x0 * x0 * x0) / 3;
  };
  const auto first = std::ranges::upper_bound(knots_, from_m, {}, &Knot::way_m) - knots_.begin();
  auto k = static_cast<std::size_t>(std::max<std::ptrdiff_t>(first - 1, 0));
  for (; k + 1 < knots_.size() && knots_[k].way_m < to_m; ++k) add(knots_[k], knots_[k + 1]);
  if (!knots_.empty()) add(knots_.back(), {last_way_m_, last_height_m_});
  return 12 * moment / (length * length * length);
}

void ClimbTracker::learn(double step_m) {
  steps_m_[steps_++ % remembered_steps] = step_m;
  std::array<double, remembered_steps> sorted = steps_m_;
  grain_m_ = median({sorted.data(), std::min(steps_, remembered_steps)});
}

double ClimbTracker::add(const ClimbReading& reading) {
  const ClimbReading before{last_utime_us_, last_speed_m_s_};
  const bool lost = reading.utime_us <= last_utime_us_ || !reading.bridged;
  if (lost) {
    profile_.clear();
    direction_ = 0;
    way_m_ = 0;
    climb_rad_ = unknown;
  }
  const double way = lost ? 0 : way_between(before, reading);
  const int direction = direction_of(reading);
  if (direction != 0 && direction_ != 0 && direction != direction_) {
    profile_.clear();
    direction_ = direction;
  } else if (direction_ == 0) {
    direction_ = direction;
  }
  way_m_ += way;
  if (!lost && way > 0 && std::isfinite(reading.height_m) && std::isfinite(last_height_m_) &&
      reading.height_m != last_height_m_)
    learn(std::fabs(reading.height_m - last_height_m_));
  last_utime_us_ = reading.utime_us;
  last_speed_m_s_ = reading.speed_m_s;
  last_height_m_ = reading.height_m;

  if (!std::isfinite(reading.height_m)) {
    profile_.clear();
    if (way > 0) climb_rad_ = unknown;
  } else {
    profile_.add(way_m_, way == 0, reading.height_m, grain_m_);
    const double reach = reach_m(reading.speed_m_s, grain_m_, 1);
    const double from = std::max(profile_.begin_m(), way_m_ - reach);
    if (way > 0 && way_m_ - from >= 0.5 * reach) {
      const double climb = climb_over(direction_ * profile_.slope(from, way_m_), 1);
      if (std::isfinite(climb)) climb_rad_ = climb;
    }
    profile_.forget_before(way_m_ - reach);
  }
  if (std::isfinite(reading.pitch_rad)) climb_rad_ = reading.pitch_rad;
  return climb_rad_;
}

namespace {

// Readings [begin, end) of one run, with the way since its first.
struct Run {
  std::size_t begin = 0, end = 0;
  int direction = 0;
};

std::vector<Run> runs_of(std::span<const ClimbReading> readings) {
  std::vector<Run> runs;
  for (std::size_t k = 0; k < readings.size(); ++k) {
    if (!std::isfinite(readings[k].height_m)) continue;
    const int direction = direction_of(readings[k]);
    const bool goes_on = !runs.empty() && runs.back().end == k && readings[k].bridged &&
                         (direction == 0 || runs.back().direction == 0 || direction == runs.back().direction);
    if (!goes_on) runs.push_back({k, k, 0});
    runs.back().end = k + 1;
    if (direction != 0) runs.back().direction = direction;
  }
  return runs;
}

double grain_of(std::span<const ClimbReading> readings) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < readings.size(); ++k) {
    const double step = std::fabs(readings[k].height_m - readings[k - 1].height_m);
    if (step > 0 && way_between(readings[k - 1], readings[k]) > 0) steps.push_back(step);
  }
  return median(steps);
}

void climb_of_run(std::span<const ClimbReading> readings, const Run& run, double grain_m,
                  std::span<double> climb_rad) {
  HeightProfile profile;
  std::vector<double> way(readings.size());
  for (std::size_t k = 0; k < readings.size(); ++k) {
    if (k > 0) way[k] = way[k - 1] + way_between(readings[k - 1], readings[k]);
    profile.add(way[k], k > 0 && way[k] == way[k - 1], readings[k].height_m, grain_m);
  }
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const double reach = reach_m(readings[k].speed_m_s, grain_m, 2);
    const double from = std::max(0.0, way[k] - reach), to = std::min(way.back(), way[k] + reach);
    if (to - from >= reach) climb_rad[k] = climb_over(run.direction * profile.slope(from, to), 1);
  }
}

}  // namespace

std::vector<double> climb_along(std::span<const ClimbReading> readings) {
  std::vector<double> climb_rad(readings.size(), unknown);
  const double grain_m = grain_of(readings);
  for (const Run& run : runs_of(readings)) {
    const std::size_t count = run.end - run.begin;
    climb_of_run(readings.subspan(run.begin, count), run, grain_m,
                 std::span(climb_rad).subspan(run.begin, count));
  }
  for (std::size_t k = 0; k < readings.size(); ++k) {
    if (std::isfinite(readings[k].pitch_rad)) climb_rad[k] = readings[k].pitch_rad;
    const bool may_hold =
        k > 0 && readings[k].bridged && (stands(readings[k]) || std::isfinite(readings[k].height_m));
    if (std::isnan(climb_rad[k]) && may_hold) climb_rad[k] = climb_rad[k - 1];
  }
  return climb_rad;
}

}  // namespace joulecast::dynamics
