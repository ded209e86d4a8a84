#include "statistics/updates.h"

#include <algorithm>
#include <cmath>

#include "statistics/robust.h"

namespace joulecast::statistics {
namespace {

constexpr std::size_t fewest_changes = 8;  // fewer say nothing of how a channel is read
// Repetitions longer than this many times the longer ones are a steady state, not a way of reading.
constexpr double steady = 4;
// Of the time in repetitions this part has to be in such as are a whole number of periods long, each to within a
// quarter of a period. Where a coarse converter repeats values by chance, lengths are geometric and less than half is.
constexpr double regular_part = 0.7, off_period = 0.25;

// The period of repeated readings in rows, or 1: none are repeated. `lengths`: of the repetitions, in rows.
double period_of(const std::vector<double>& lengths) {
  if (lengths.size() < fewest_changes) return 1;
  const double longer = statistics::quantile(lengths, 0.75);
  std::vector<double> usual;
  double total = 0;
  for (const double n : lengths) {
    if (n <= steady * longer) usual.push_back(n), total += n;
  }
  std::ranges::sort(usual);
  // The length in which half of the time lies.
  double period = 1, sum = 0;
  for (const double n : usual) {
    sum += n;
    period = n;
    if (sum >= 0.5 * total) break;
  }
  if (period < 2) return 1;
  double regular = 0;
  for (const double n : usual) {
    const double times = std::max(1.0, std::round(n / period));
    if (std::fabs(n - times * period) <= off_period * period + 0.5) regular += n;
  }
  return regular >= regular_part * total ? period : 1;
}

}  // namespace

Updates find_updates(std::span<const double> time_s, std::span<const double> value) {
  std::vector<std::size_t> known, changes;  // changes: places in `known`
  for (std::size_t k = 0; k < value.size(); ++k) {
    if (!std::isfinite(value[k])) continue;
    if (!known.empty() && value[known.back()] != value[k]) changes.push_back(known.size());
    known.push_back(k);
  }
  Updates updates;
  if (known.size() < 2) {
    updates.at = std::move(known);
    return updates;
  }
  std::vector<double> row_steps, lengths;
  for (std::size_t k = 1; k < known.size(); ++k) row_steps.push_back(time_s[known[k]] - time_s[known[k - 1]]);
  for (std::size_t c = 1; c < changes.size(); ++c)
    lengths.push_back(static_cast<double>(changes[c] - changes[c - 1]));
  const double rows = period_of(lengths);
  updates.period_s = rows * median(std::move(row_steps));
  updates.held = rows > 1;
  if (!updates.held) {
    updates.at = std::move(known);
    return updates;
  }
  // Two sensors summed into one channel change it twice a period, shortly after each other: the reading is there
  // when both have. The first row may repeat a reading of before the table began.
  for (std::size_t c = 0; c < changes.size(); ++c) {
    const std::size_t end = c + 1 < changes.size() ? changes[c + 1] : known.size();
    const double stood = static_cast<double>(end - changes[c]);
    if (stood < 0.5 * rows && c + 1 < changes.size()) continue;
    const auto readings = std::max(1.0, std::round(stood / rows));
    for (double n = 0; n < readings; ++n)
      updates.at.push_back(known[changes[c] + static_cast<std::size_t>(n * stood / readings)]);
  }
  return updates;
}

}  // namespace joulecast::statistics
