#include "gap/checks/repetitions.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {
namespace {

constexpr std::size_t fewest_changes = 8;  // fewer are not sufficient
// Repetitions longer than this many times the upper quartile are a steady state, not held readings.
constexpr double steady = 4;
// Share of the time in repetitions that must be in repetitions of a whole number of periods, each to within a
// quarter of a period. Where a coarse converter repeats values by chance, lengths are geometric and the share
// is less than half.
constexpr double regular_part = 0.7, off_period = 0.25;

// The first length, in order, at which the cumulative share reaches `part`. `part_of`: weight of an entry.
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

}  // namespace joulecast::gap
