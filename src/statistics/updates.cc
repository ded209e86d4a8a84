#include "statistics/updates.h"

#include <algorithm>
#include <cmath>

#include "statistics/robust.h"

namespace joulecast::statistics {
namespace {

constexpr std::size_t fewest_changes = 8;  // fewer do not show how a channel is read
// Repetitions longer than this many times the longer ones are a steady state, not a way of reading.
constexpr double steady = 4;
// Mean square of the deviations of repetitions from whole numbers of periods, in periods. Where values repeat
// by chance it is at least that of a uniform variable. A held channel's must be below it by several standard
// deviations of a mean of chances (0.0745 is that of one), more than the choice of a period can account for.
constexpr double by_chance = 1.0 / 12, most_missed = 0.05, surely = 3 * 0.0745;

constexpr double fewest_settled = 0.4;  // of the changes, of which two sensors make a half

// Changes after which the value stood for half a period or longer, and the last one. Two sensors summed into
// one channel change it twice a period, shortly after each other: the reading is there when both have.
std::vector<std::size_t> kept_changes(const std::vector<std::size_t>& changes, double period) {
  std::vector<std::size_t> kept;
  for (std::size_t c = 0; c < changes.size(); ++c) {
    if (c + 1 == changes.size() || static_cast<double>(changes[c + 1] - changes[c]) >= 0.5 * period)
      kept.push_back(changes[c]);
  }
  return kept;
}

struct Fit {
  double period = 1, missed = 1;  // rows; mean square in periods
  std::size_t count = 0;
};

// The deviation of changes from whole numbers of about `period` rows, and the best period.
Fit fit_period(const std::vector<std::size_t>& changes, double period, double longest) {
  const std::vector<std::size_t> kept = kept_changes(changes, period);
  Fit fit;
  if (static_cast<double>(kept.size()) < fewest_settled * static_cast<double>(changes.size())) return fit;
  double nn = 0, nt = 0, tt = 0;
  for (std::size_t c = 1; c < kept.size(); ++c) {
    const auto rows = static_cast<double>(kept[c] - kept[c - 1]);
    if (rows > longest) continue;
    const double times = std::max(1.0, std::round(rows / period));
    nn += rows * rows, nt += rows * times, tt += times * times;
    ++fit.count;
  }
  if (fit.count < fewest_changes) return fit;
  fit.period = nt / tt;
  // A row is as wide as 1/12 of variance: of periods that fit as well the longest.
  const auto n = static_cast<double>(fit.count);
  fit.missed = ((nn - nt * fit.period) / n + 1.0 / 12) / (fit.period * fit.period);
  return fit;
}

// The period of repeated readings in rows, or 1: none are repeated.
double period_of(const std::vector<std::size_t>& changes) {
  if (changes.size() <= fewest_changes) return 1;
  std::vector<double> lengths;
  for (std::size_t c = 1; c < changes.size(); ++c)
    lengths.push_back(static_cast<double>(changes[c] - changes[c - 1]));
  const double longest = steady * quantile(lengths, 0.75);
  std::ranges::sort(lengths);
  const auto same = std::ranges::unique(lengths);
  lengths.erase(same.begin(), same.end());
  Fit best;
  for (const double length : lengths) {
    if (length < 2 || length > longest) continue;
    const Fit fit = fit_period(changes, length, longest);
    if (fit.period >= 2 && fit.missed < best.missed) best = fit;
  }
  const double most = std::min(most_missed, by_chance - surely / std::sqrt(static_cast<double>(best.count)));
  return best.count > 0 && best.missed < most ? best.period : 1;
}

}  // namespace

Updates find_updates(std::span<const double> time_s, std::span<const double> value) {
  std::vector<std::size_t> known, changes;  // changes: indices into it
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
  std::vector<double> row_steps, known_steps;
  for (std::size_t k = 1; k < time_s.size(); ++k) row_steps.push_back(time_s[k] - time_s[k - 1]);
  for (std::size_t k = 1; k < known.size(); ++k)
    known_steps.push_back(time_s[known[k]] - time_s[known[k - 1]]);
  const double rows = period_of(changes);
  updates.period_s = rows * median(std::move(known_steps));
  updates.held = updates.period_s > 1.5 * median(std::move(row_steps));
  if (rows == 1) {
    updates.at = std::move(known);
    return updates;
  }
  // The first row may repeat a reading of before the table began.
  const std::vector<std::size_t> kept = kept_changes(changes, rows);
  for (std::size_t c = 0; c < kept.size(); ++c) {
    const auto stood = static_cast<double>((c + 1 < kept.size() ? kept[c + 1] : known.size()) - kept[c]);
    const double readings = std::max(1.0, std::round(stood / rows));
    for (double n = 0; n < readings; ++n)
      updates.at.push_back(known[kept[c] + static_cast<std::size_t>(n * stood / readings)]);
  }
  return updates;
}

}  // namespace joulecast::statistics
