#include "telemetry/import_samples.h"

#include <fmt/format.h>

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
  constexpr double times = 8, of_changes = 0.9;  // quantile of those that are not 0; see csv_import_test
  std::vector<std::size_t> read;
  for (std::size_t k = 0; k < position.size(); ++k)
    if (!std::isnan(position[k])) read.push_back(k);
  std::vector<double> rate(read.size()), changes, jumps;
  for (std::size_t k = 1; k < read.size(); ++k) {
    rate[k] = (position[read[k]] - position[read[k - 1]]) / (time_s[read[k]] - time_s[read[k - 1]]);
    if (k > 1 && rate[k] != rate[k - 1]) changes.push_back(std::abs(rate[k] - rate[k - 1]));
  }
  const double usual = times * quantile(changes, of_changes);
  double shift = 0;
  for (std::size_t k = 1; k < read.size(); ++k) {
    const bool inner = k > 1 && k + 1 < read.size();
    const double there = inner ? rate[k] - rate[k - 1] : 0, back = inner ? rate[k] - rate[k + 1] : 0;
    if (usual > 0 && std::min(std::abs(there), std::abs(back)) > usual && there * back > 0) {
      rate[k] = rate[k - 1];
      jumps.push_back(there * (time_s[read[k]] - time_s[read[k - 1]]));
      shift -= jumps.back();
    }
    position[read[k]] += shift;
  }
  return jumps;
}

bool same_value(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
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
    const auto sum = [&](const auto& value) {
      // The neighbours at least.
      const std::size_t first = std::min(begin, k == 0 ? 0 : k - 1);
      const std::size_t behind = std::max(end, std::min(k + 2, samples.size()));
      double total = 0;
      for (std::size_t j = first; j < behind; ++j)
        if (!std::isnan(position[j])) total += value(seconds(at, samples[j].utime_us), position[j]);
      return total;
    };
    const double n = sum([](double, double) { return 1; });
    const double t = sum([](double dt, double) { return dt; }) / n;
    const double y = sum([](double, double p) { return p; }) / n;
    const double tt = sum([&](double dt, double) { return (dt - t) * (dt - t); });
    const double ty = sum([&](double dt, double p) { return (dt - t) * (p - y); });
    *signals::numbers_of(samples[k])[number] = n >= 2 && tt > 0 ? ty / tt : signals::unmeasured;
  }
  return thrown;
}

std::size_t hold_between(std::vector<signals::Sample>& samples) {
  std::vector<double> intervals_us;
  for (std::size_t k = 1; k < samples.size(); ++k)
    intervals_us.push_back(static_cast<double>(samples[k].utime_us - samples[k - 1].utime_us));
  const std::int64_t period_us = std::max<std::int64_t>(std::llround(quantile(intervals_us, 0.5)), 1);
  std::vector<signals::Sample> held;
  for (const signals::Sample& sample : samples) {
    const std::int64_t last_us = sample.utime_us - period_us;
    while (!held.empty() && held.back().utime_us < last_us) {
      held.push_back(held.back());
      std::int64_t& utime_us = held.back().utime_us;
      utime_us = std::min(utime_us + std::max<std::int64_t>(period_us, 1'000'000), last_us);
    }
    held.push_back(sample);
  }
  const std::size_t added = held.size() - samples.size();
  samples = std::move(held);
  for (std::size_t k = 0; k < samples.size(); ++k) samples[k].sequence = static_cast<std::int64_t>(k);
  return added;
}

Result<void> ImportedCovariates::set_label(const std::string& quantity, std::string_view text) {
  auto& [now, label, labels, changes] = labelled_[quantity];
  label.clear();
  for (const char c : text) {
    // Bytes that continue a character of UTF-8 are part of it.
    const bool continues = (static_cast<unsigned char>(c) & 0xC0) == 0x80;
    if (!continues) label += signals::is_valid_covariate_name(std::string_view(&c, 1)) ? c : '_';
  }
  if (label.size() > signals::max_covariate_name_length)
    return fail(Fault::corrupt, "",
                fmt::format("is longer than the {} characters that a label may have",
                            signals::max_covariate_name_length));
  if (!label.empty() && labels.size() == max_import_labels &&
      std::ranges::find(labels, label) == labels.end())
    return fail(
        Fault::corrupt, "",
        fmt::format("is one label of {} too many; at most {} are allowed", quantity, max_import_labels));
  return {};
}

void ImportedCovariates::commit(std::int64_t utime_us) {
  for (auto& [name, quantity] : labelled_) {
    auto& [now, label, labels, changes] = quantity;
    const auto place = std::ranges::find(labels, label) - labels.begin();
    now = label.empty() ? signals::unmeasured : static_cast<double>(place);
    if (!label.empty() && place == std::ssize(labels)) labels.push_back(label);
  }
  for (auto* all : {&numbers_, &labelled_})
    for (auto& [name, quantity] : *all) {
      auto& changes = quantity.changes;
      if (!same_value(quantity.now, changes.empty() ? signals::unmeasured : changes.back().second))
        changes.emplace_back(utime_us, quantity.now);
    }
}

Result<std::vector<signals::CovariateSeries>> ImportedCovariates::finish() {
  std::vector<signals::CovariateSeries> all;
  for (auto* quantities : {&numbers_, &labelled_})
    for (auto& [quantity, content] : *quantities) {
      const auto changes = std::exchange(content.changes, {});
      const std::size_t count = std::max<std::size_t>(content.labels.size(), 1);
      for (std::size_t k = 0; k < count && !changes.empty(); ++k) {
        const bool label = quantities == &labelled_;
        signals::CovariateSeries& series = all.emplace_back();
        series.name = label ? quantity + "=" + content.labels[k] : quantity;
        for (const auto& [utime_us, now] : changes) {
          const double value = label && !std::isnan(now) ? now == static_cast<double>(k) : now;
          if (!series.value.empty() && same_value(series.value.back(), value)) continue;
          series.utime_us.push_back(utime_us);
          series.value.push_back(value);
        }
      }
    }
  std::ranges::stable_sort(all, {}, [](const auto& series) { return series.utime_us.front(); });
  if (all.size() > signals::max_covariates)
    return invalid("covariates", fmt::format("are {} with every label; a recording has at most {}",
                                             all.size(), signals::max_covariates));
  return all;
}

}  // namespace joulecast::telemetry
