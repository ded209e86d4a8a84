#include "statistics/updates.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "statistics/robust.h"

namespace joulecast::statistics {
namespace {

constexpr std::size_t fewest_changes = 8;  // fewer say nothing of how a channel is read
// Repetitions longer than this many times the longer ones are a steady state, not a way of reading.
constexpr double steady = 4;
// Of the time in repetitions this part has to be in such as are a whole number of periods long, each to
// within a quarter of a period. Where a coarse converter repeats values by chance, lengths are geometric and
// less than half is.
constexpr double regular_part = 0.7, off_period = 0.25;

// The first length up to which, in order, this part of all is met. `part_of`: what one entry counts for.
std::size_t length_at(std::span<const Repetitions> lengths, double part, const auto& part_of) {
  double total = 0, sum = 0;
  for (const Repetitions& r : lengths) total += part_of(r);
  for (const Repetitions& r : lengths) {
    sum += part_of(r);
    if (sum >= part * total) return r.rows;
  }
  return 1;
}

}  // namespace

std::size_t rows_held(std::span<const Repetitions> lengths) {
  const auto count_of = [](const Repetitions& r) { return static_cast<double>(r.count); };
  const auto time_of = [](const Repetitions& r) { return static_cast<double>(r.count * r.rows); };
  std::size_t count = 0;
  for (const Repetitions& r : lengths) count += r.count;
  if (count < fewest_changes) return 1;
  const double longest = steady * static_cast<double>(length_at(lengths, 0.75, count_of));
  while (static_cast<double>(lengths.back().rows) > longest) lengths = lengths.first(lengths.size() - 1);
  const std::size_t held = length_at(lengths, 0.5, time_of);
  if (held < 2) return 1;
  const double period = static_cast<double>(held);
  double total = 0, regular = 0;
  for (const Repetitions& r : lengths) {
    const double rows = static_cast<double>(r.rows), times = std::max(1.0, std::round(rows / period));
    total += time_of(r);
    if (std::fabs(rows - times * period) <= off_period * period + 0.5) regular += time_of(r);
  }
  return regular >= regular_part * total ? held : 1;
}

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
  std::vector<double> row_steps;
  for (std::size_t k = 1; k < known.size(); ++k) row_steps.push_back(time_s[known[k]] - time_s[known[k - 1]]);
  std::map<std::size_t, std::size_t> count;  // by length
  for (std::size_t c = 1; c < changes.size(); ++c) ++count[changes[c] - changes[c - 1]];
  std::vector<Repetitions> lengths;
  for (const auto& [length, times] : count) lengths.push_back({length, times});
  const double rows = static_cast<double>(rows_held(lengths));
  updates.period_s = rows * median(std::move(row_steps));
  updates.held = rows > 1;
  if (!updates.held) {
    updates.at = std::move(known);
    return updates;
  }
  // Two sensors summed into one channel change it twice a period, shortly after each other: the reading is
  // there when both have. The first row may repeat a reading of before the table began.
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
