#include "statistics/updates.h"

#include <cmath>

#include "statistics/robust.h"

namespace joulecast::statistics {
namespace {

constexpr std::size_t fewest_changes = 8;  // fewer say nothing of how a channel is read
// Of the repetitions between changes this fraction may be shorter than the period: rows come late or early.
constexpr double short_fraction = 0.1;

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
  std::vector<double> row_steps, lengths_s, lengths;
  for (std::size_t k = 1; k < known.size(); ++k) row_steps.push_back(time_s[known[k]] - time_s[known[k - 1]]);
  const double row_s = median(row_steps);
  updates.period_s = row_s;
  for (std::size_t c = 1; c < changes.size(); ++c) {
    lengths.push_back(static_cast<double>(changes[c] - changes[c - 1]));
    lengths_s.push_back(time_s[known[changes[c]]] - time_s[known[changes[c - 1]]]);
  }
  if (lengths.size() >= fewest_changes && quantile(lengths, short_fraction) >= 2) {
    updates.held = true;
    // The shortest usual repetition is one reading; longer ones are readings that came out alike.
    const double shortest = quantile(lengths_s, short_fraction);
    std::vector<double> single;
    for (const double s : lengths_s) {
      if (s < 1.5 * shortest) single.push_back(s);
    }
    updates.period_s = median(std::move(single));
  }
  if (!updates.held) {
    updates.at = std::move(known);
    return updates;
  }
  // A gap in the table ends what is known of a reading.
  const double longest_s = updates.period_s + 1.5 * row_s;
  double last_s = -1e300;
  std::size_t next_change = 0;
  for (std::size_t k = 0; k < known.size(); ++k) {
    const double t = time_s[known[k]];
    const bool changed = next_change < changes.size() && changes[next_change] == k;
    if (changed) ++next_change;
    // The first row may repeat a reading of before the table began: nothing tells when it was taken.
    if (!changed && (k == 0 || t - last_s < updates.period_s - 0.5 * row_s)) continue;
    if (!changed && updates.at.empty() && t - time_s[known.front()] < longest_s) continue;
    updates.at.push_back(known[k]);
    last_s = t;
  }
  return updates;
}

}  // namespace joulecast::statistics
