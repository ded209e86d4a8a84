#include "tests/study/ramp/ramp.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

#include "base/try.h"

namespace joulecast::planning {
namespace {

double cruise_speed(const LineTask& task, double duration, double fraction) {
  // D = T ((v0 + v) f/2 + v (1 - 2f) + (v + vf) f/2).
  return (task.distance / duration - (task.start_speed + task.end_speed) * fraction / 2) / (1 - fraction);
}

RampProfile shape(const LineTask& task, double duration, double fraction) {
  const double v = cruise_speed(task, duration, fraction), ramp = fraction * duration;
  return RampProfile(task.power, {{{ramp, task.start_speed, (v - task.start_speed) / ramp},
                                   {duration - 2 * ramp, v, 0},
                                   {ramp, v, (task.end_speed - v) / ramp}}});
}

Result<void> validate(const LineTask& task, double fraction) {
  if (!(task.distance > 0)) {
    return invalid("distance", "is " + std::to_string(task.distance) + ", must be positive");
  }
  if (!(task.start_speed >= 0 && task.end_speed >= 0))
    return invalid("start_speed", "end speeds must not be negative");
  if (!(fraction > 0 && fraction <= 0.5)) {
    return invalid("ramp_fraction", "is " + std::to_string(fraction) + ", must be in (0, 0.5]");
  }
  return {};
}

}  // namespace

RampProfile::RampProfile(const dynamics::QuadraticPower& power, const std::array<Span, 3>& spans)
    : power_(power), spans_(spans) {}

double RampProfile::duration_s() const {
  return spans_[0].duration_s + spans_[1].duration_s + spans_[2].duration_s;
}

double RampProfile::distance() const {
  double sum = 0;
  for (const Span& s : spans_) sum += s.duration_s * (s.start_speed + s.acceleration * s.duration_s / 2);
  return sum;
}

double RampProfile::peak_speed() const {
  double peak = 0;
  for (const Span& s : spans_) {
    peak = std::max({peak, s.start_speed, s.start_speed + s.acceleration * s.duration_s});
  }
  return peak;
}

double RampProfile::energy_j() const {
  double sum = 0;
  for (const Span& s : spans_) {
    const double v1 = s.start_speed + s.acceleration * s.duration_s;
    sum +=
        s.duration_s / 6 *
        (power_.power_w(s.start_speed, s.acceleration) +
         4 * power_.power_w(0.5 * (s.start_speed + v1), s.acceleration) + power_.power_w(v1, s.acceleration));
  }
  return sum;
}

LineSample RampProfile::at(double time_s) const {
  LineSample sample;
  sample.time_s = time_s;
  double left = time_s;
  for (std::size_t k = 0; k < spans_.size(); ++k) {
    const Span& s = spans_[k];
    const bool here = left < s.duration_s || k + 1 == spans_.size();
    const double t = here ? left : s.duration_s;
    const double v = s.start_speed + s.acceleration * t;
    sample.energy_j +=
        t / 6 *
        (power_.power_w(s.start_speed, s.acceleration) +
         4 * power_.power_w(0.5 * (s.start_speed + v), s.acceleration) + power_.power_w(v, s.acceleration));
    sample.distance += t * 0.5 * (s.start_speed + v);
    if (here) {
      sample.speed = v;
      sample.acceleration = s.acceleration;
      sample.power_w = power_.power_w(v, s.acceleration);
      break;
    }
    left -= s.duration_s;
  }
  return sample;
}

std::vector<LineSample> RampProfile::sample(std::size_t count) const {
  assert(count >= 2);
  std::vector<LineSample> samples;
  samples.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    samples.push_back(at(duration_s() * static_cast<double>(k) / static_cast<double>(count - 1)));
  }
  return samples;
}

Result<RampProfile> ramp_in_time(const LineTask& task, double duration_s, double fraction) {
  TRY(validate(task, fraction));
  if (!(std::isfinite(duration_s) && duration_s > 0)) {
    return invalid("duration_s", "is " + std::to_string(duration_s) + ", must be positive and finite");
  }
  if (cruise_speed(task, duration_s, fraction) < 0) {
    const double longest = 2 * task.distance / (fraction * (task.start_speed + task.end_speed));
    return fail(Fault::infeasible, "duration_s",
                "is " + std::to_string(duration_s) + " s; with these end speeds this shape lasts at most " +
                    std::to_string(longest) + " s");
  }
  return shape(task, duration_s, fraction);
}

Result<RampProfile> ramp_in_free_time(const LineTask& task, double fraction) {
  TRY(validate(task, fraction));
  const double price = task.power.c0 + task.value_of_time_w;
  if (!(price > 0)) return invalid("value_of_time_w", "plus the power at standstill must be positive");
  // The cost is a polynomial in 1/T times T; it falls, then rises. Golden section on log T.
  const auto cost = [&](double log_duration) {
    const RampProfile ramp = shape(task, std::exp(log_duration), fraction);
    return ramp.energy_j() + task.value_of_time_w * ramp.duration_s();
  };
  const double ends = task.start_speed + task.end_speed;
  const double guess = std::sqrt(6 * task.distance * std::sqrt(task.power.c1 / price));
  double low = std::log(guess) - 12,
         high = std::log(guess * (1 + guess * std::sqrt(task.power.c2 / task.power.c1))) + 3;
  if (ends > 0) high = std::min(high, std::log(2 * task.distance / (fraction * ends)));
  low = std::min(low, high - 12);
  constexpr double golden = 0.6180339887498949;
  double a = high - golden * (high - low), b = low + golden * (high - low), fa = cost(a), fb = cost(b);
  while (high - low > 1e-8) {
    if (fa < fb) {
      high = b, b = a, fb = fa;
      a = high - golden * (high - low), fa = cost(a);
    } else {
      low = a, a = b, fa = fb;
      b = low + golden * (high - low), fb = cost(b);
    }
  }
  return shape(task, std::exp(0.5 * (low + high)), fraction);
}

Result<RampProfile> ramp_by_limits(const LineTask& task, double speed_limit, double acceleration_limit) {
  TRY(validate(task, 0.5));
  if (!(speed_limit > 0)) return invalid("speed_limit", "must be positive");
  if (!(acceleration_limit > 0)) return invalid("acceleration_limit", "must be positive");
  const double v0 = task.start_speed, vf = task.end_speed, a = acceleration_limit;
  if (std::max(v0, vf) > speed_limit) {
    return fail(Fault::infeasible, v0 > vf ? "start_speed" : "end_speed",
                "exceeds the speed limit of " + std::to_string(speed_limit));
  }
  const double shortest = std::fabs(v0 * v0 - vf * vf) / (2 * a);
  if (shortest > task.distance) {
    return fail(Fault::infeasible, "distance",
                "is " + std::to_string(task.distance) + ", too short for the end speeds; the shortest is " +
                    std::to_string(shortest));
  }
  const double peak = std::min(speed_limit, std::sqrt(a * task.distance + (v0 * v0 + vf * vf) / 2));
  const double up = (peak * peak - v0 * v0) / (2 * a), down = (peak * peak - vf * vf) / (2 * a);
  const double cruise = std::max(0.0, task.distance - up - down) / peak;
  return RampProfile(task.power,
                     {{{(peak - v0) / a, v0, a}, {cruise, peak, 0}, {(peak - vf) / a, peak, -a}}});
}

}  // namespace joulecast::planning
