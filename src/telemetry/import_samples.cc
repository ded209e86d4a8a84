#include "telemetry/import_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace joulecast::telemetry {
namespace {

double seconds(std::int64_t from_us, std::int64_t to_us) {
  return 1e-6 * static_cast<double>(to_us - from_us);
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + std::llround(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

// Takes jumps out of positions at times in seconds.
std::vector<double> take_jumps(std::vector<double>& position, const std::vector<double>& time_s) {
  // A jump changes the rate twice, there and back. Turning wheels, quantised by their encoder, change it by
  // this at most:
  constexpr double times = 8, of_changes = 0.9;  // quantile of those that are not 0; see import_samples_test
  std::vector<std::size_t> read;
  for (std::size_t k = 0; k < position.size(); ++k)
    if (!std::isnan(position[k])) read.push_back(k);
  std::vector<double> rate(read.size()), changes;
  for (std::size_t k = 1; k < read.size(); ++k) {
    rate[k] = (position[read[k]] - position[read[k - 1]]) / (time_s[read[k]] - time_s[read[k - 1]]);
    if (k > 1 && rate[k] != rate[k - 1]) changes.push_back(std::abs(rate[k] - rate[k - 1]));
  }
  const double usual = times * quantile(changes, of_changes);
  std::vector<double> jumps;
  double shift = 0;
  for (std::size_t k = 1; k < read.size(); ++k) {
    if (k > 1 && k + 1 < read.size()) {
      const double there = rate[k] - rate[k - 1], back = rate[k] - rate[k + 1];
      if (usual > 0 && std::min(std::abs(there), std::abs(back)) > usual && there * back > 0) {
        rate[k] = rate[k - 1];
        jumps.push_back(there * (time_s[read[k]] - time_s[read[k - 1]]));
        shift -= jumps.back();
      }
    }
    position[read[k]] += shift;
  }
  return jumps;
}

}  // namespace

double leap_of(const std::vector<signals::Sample>& samples, std::size_t number) {
  double low = std::numeric_limits<double>::infinity(), high = -low, last = signals::unmeasured;
  std::vector<double> steps;
  for (const signals::Sample& sample : samples) {
    const double position = *signals::numbers_of(sample)[number];
    if (std::isnan(position)) continue;
    if (!std::isnan(last)) steps.push_back(std::abs(position - last));
    low = std::min(low, position);
    high = std::max(high, position);
    last = position;
  }
  // Such leaps are few; a wheel that turns fast between rows steps by any amount.
  const auto leaps = std::ranges::count_if(steps, [&](double step) { return 2 * step > high - low; });
  return leaps > 0 && static_cast<std::size_t>(3 * leaps) < steps.size() ? high - low : 0;
}

std::vector<double> differentiate(std::vector<signals::Sample>& samples, std::size_t number,
                                  double window_s) {
  std::vector<double> position, time_s;
  for (const signals::Sample& sample : samples) {
    position.push_back(*signals::numbers_of(sample)[number]);
    time_s.push_back(seconds(samples.front().utime_us, sample.utime_us));
  }
  std::vector<double> thrown = take_jumps(position, time_s);
  std::size_t begin = 0, end = 0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const std::int64_t at = samples[k].utime_us;
    while (seconds(samples[begin].utime_us, at) > window_s / 2) ++begin;
    while (end < samples.size() && seconds(at, samples[end].utime_us) <= window_s / 2) ++end;
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
  return thrown;
}

std::size_t hold_between(std::vector<signals::Sample>& samples) {
  std::vector<double> intervals_us;
  for (std::size_t k = 1; k < samples.size(); ++k)
    intervals_us.push_back(static_cast<double>(samples[k].utime_us - samples[k - 1].utime_us));
  const std::int64_t period_us = std::llround(quantile(intervals_us, 0.5));
  std::vector<signals::Sample> held;
  for (const signals::Sample& sample : samples) {
    if (!held.empty()) {
      signals::Sample before = held.back();
      const std::int64_t last_us = sample.utime_us - std::max(period_us, std::int64_t{1});
      while (before.utime_us < last_us) {
        before.utime_us = std::min(before.utime_us + std::max<std::int64_t>(period_us, 1'000'000), last_us);
        held.push_back(before);
      }
    }
    held.push_back(sample);
  }
  const std::size_t added = held.size() - samples.size();
  samples = std::move(held);
  for (std::size_t k = 0; k < samples.size(); ++k) samples[k].sequence = static_cast<std::int64_t>(k);
  return added;
}

}  // namespace joulecast::telemetry
