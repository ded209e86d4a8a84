#include "telemetry/import_samples.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace joulecast::telemetry {
namespace {

// Short beside any sample interval: what a straight line misses of a step goes with it.
constexpr std::int64_t step_us = 100;

double seconds(std::int64_t from_us, std::int64_t to_us) {
  return 1e-6 * static_cast<double>(to_us - from_us);
}

void unwrap(std::vector<double>& values, double period) {
  double shift = 0, last = signals::unmeasured;
  for (double& value : values) {
    if (std::isnan(value)) continue;
    if (!std::isnan(last)) shift -= period * std::round((value - last) / period);
    last = value;
    value += shift;
  }
}

}  // namespace

void differentiate(std::vector<signals::Sample>& samples, std::size_t number, const RateOf& rate) {
  std::vector<double> position;
  for (const signals::Sample& sample : samples) position.push_back(*signals::numbers_of(sample)[number]);
  if (rate.wraps_at) unwrap(position, *rate.wraps_at);
  std::size_t begin = 0, end = 0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const std::int64_t at = samples[k].utime_us;
    const double reach_s = rate.window_s / 2;
    while (seconds(samples[begin].utime_us, at) > reach_s) ++begin;
    while (end < samples.size() && seconds(at, samples[end].utime_us) <= reach_s) ++end;
    // The neighbours at least.
    const std::size_t first = std::min(begin, k == 0 ? 0 : k - 1);
    const std::size_t behind = std::max(end, std::min(k + 2, samples.size()));
    double n = 0, t = 0, y = 0;
    for (std::size_t j = first; j < behind; ++j) {
      if (std::isnan(position[j])) continue;
      n += 1;
      t += seconds(at, samples[j].utime_us);
      y += position[j];
    }
    double tt = 0, ty = 0;
    for (std::size_t j = first; j < behind; ++j) {
      if (std::isnan(position[j])) continue;
      const double dt = seconds(at, samples[j].utime_us) - t / n;
      tt += dt * dt;
      ty += dt * (position[j] - y / n);
    }
    *signals::numbers_of(samples[k])[number] = n >= 2 && tt > 0 ? ty / tt : signals::unmeasured;
  }
}

std::size_t add_steps(std::vector<signals::Sample>& samples, const std::vector<std::size_t>& numbers) {
  if (numbers.empty()) return 0;
  std::vector<signals::Sample> stepped;
  for (const signals::Sample& sample : samples) {
    const bool changes = !stepped.empty() && std::ranges::any_of(numbers, [&](std::size_t number) {
      const double before = *signals::numbers_of(stepped.back())[number];
      const double now = *signals::numbers_of(sample)[number];
      return before != now && !std::isnan(before) && !std::isnan(now);
    });
    if (changes && sample.utime_us - stepped.back().utime_us > 2 * step_us) {
      signals::Sample corner = sample;
      corner.utime_us -= step_us;
      for (const std::size_t number : numbers)
        *signals::numbers_of(corner)[number] = *signals::numbers_of(stepped.back())[number];
      stepped.push_back(corner);
    }
    stepped.push_back(sample);
  }
  const std::size_t added = stepped.size() - samples.size();
  samples = std::move(stepped);
  for (std::size_t k = 0; k < samples.size(); ++k) samples[k].sequence = static_cast<std::int64_t>(k);
  return added;
}

}  // namespace joulecast::telemetry
