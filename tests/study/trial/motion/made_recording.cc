#include "tests/study/trial/motion/made_recording.h"

#include <algorithm>
#include <cmath>

namespace joulecast::trial::motion {
namespace {

constexpr double shortest_block_s = 5, longest_block_s = 20;

double rounded(double value, double step) {
  return step > 0 ? step * std::round(value / step) : value;
}

// The current i at which (V - R (i - i_before)) i is this power; a battery that cannot give it gives its
// most.
double current_of(double power_w, const Instant& before, double resistance_ohm) {
  const double source_v = before.voltage_v + resistance_ohm * before.current_a;
  if (!(resistance_ohm > 0)) return power_w / source_v;
  const double discriminant = std::max(0.0, source_v * source_v - 4 * resistance_ohm * power_w);
  return (source_v - std::sqrt(discriminant)) / (2 * resistance_ohm);
}

}  // namespace

std::vector<std::vector<double>> resampled(const std::vector<std::vector<double>>& residual_w,
                                           double period_s, virtual_robot::Rng& rng) {
  std::vector<std::vector<double>> made;
  for (const auto& wanted : residual_w) {
    auto& out = made.emplace_back();
    while (out.size() < wanted.size()) {
      const double length_s = rng.uniform(shortest_block_s, longest_block_s);
      const auto length = static_cast<std::size_t>(std::ceil(length_s / period_s));
      // Every place that a whole block fits in is as likely as any other.
      const auto places = [&](const std::vector<double>& r) {
        return r.empty() ? 0 : r.size() > length ? r.size() - length + 1 : 1;
      };
      std::size_t count = 0;
      for (const auto& r : residual_w) count += places(r);
      std::size_t place = rng.index(count);
      auto from = residual_w.begin();
      while (place >= places(*from)) place -= places(*from++);
      const std::size_t taken = std::min({length, from->size() - place, wanted.size() - out.size()});
      const auto first = from->begin() + static_cast<std::ptrdiff_t>(place);
      out.insert(out.end(), first, first + static_cast<std::ptrdiff_t>(taken));
    }
  }
  return made;
}

std::vector<telemetry::Recording> made_recording(const MotionLog& log,
                                                 const std::vector<std::vector<MeteredPower>>& power) {
  std::vector<telemetry::Recording> made = log.missions;
  for (std::size_t m = 0; m < made.size(); ++m) {
    const std::vector<Instant>& instants = log.instants[m];
    std::size_t next = 0;
    double held_a = signals::unmeasured, sag_v = 0;
    for (std::size_t k = 0; k < made[m].samples.size(); ++k) {
      signals::Sample& sample = made[m].samples[k];
      if (next < instants.size() && instants[next].sample == k) {
        const Instant& at = instants[next];
        const double drawn_a = current_of(power[m][next].drawn_w, at, log.battery.resistance_ohm);
        sag_v = log.battery.resistance_ohm * (drawn_a - at.current_a);
        held_a = rounded(power[m][next].read_w / rounded(at.voltage_v - sag_v, log.battery.voltage_step_v),
                         log.battery.current_step_a);
        ++next;
      }
      if (std::isfinite(sample.battery_current_a)) sample.battery_current_a = held_a;
      sample.battery_voltage_v = rounded(sample.battery_voltage_v - sag_v, log.battery.voltage_step_v);
      sample.motor_voltage_v.fill(signals::unmeasured);
      sample.motor_current_a.fill(signals::unmeasured);
    }
  }
  return made;
}

}  // namespace joulecast::trial::motion
