#include "drift/marks.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "drift/chance.h"
#include "statistics/robust.h"

namespace joulecast::drift {
namespace {

// Scatter of single missions, from differences of neighbours.
double scatter_of(std::span<const double> ratios) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < ratios.size(); ++k) steps.push_back(std::fabs(ratios[k] - ratios[k - 1]));
  if (steps.empty()) return least_scatter;
  return std::max(least_scatter, gaussian_mad * statistics::median(std::move(steps)) / std::sqrt(2.0));
}

class Stretch {
 public:
  Stretch(std::span<const double> ratios, const Settings& settings)
      : ratios_(ratios), settings_(settings), scatter_(scatter_of(ratios)), sums_{0} {
    for (const double r : ratios) sums_.push_back(sums_.back() + r);
  }

  std::vector<std::size_t> cuts() {
    split(0, ratios_.size());
    std::ranges::sort(cuts_);
    return cuts_;
  }
  double mean(std::size_t from, std::size_t to) const {
    return (sums_[to] - sums_[from]) / static_cast<double>(to - from);
  }
  double error(std::size_t a, std::size_t b) const {
    return scatter_ * std::sqrt(1 / static_cast<double>(a) + 1 / static_cast<double>(b));
  }
  double freedom() const { return std::max(1.0, static_cast<double>(ratios_.size()) - 2); }

 private:
  void split(std::size_t from, std::size_t to) {
    const std::size_t least = settings_.least_missions;
    if (to - from < 2 * least) return;
    std::size_t best = 0;
    double strongest = 0;
    for (std::size_t cut = from + least; cut + least <= to; ++cut) {
      const double shift = mean(cut, to) - mean(from, cut);
      const double z = std::fabs(shift) / error(cut - from, to - cut);
      if (z > strongest) strongest = z, best = cut;
    }
    const double places = static_cast<double>(to - from - 2 * least + 1);
    const double shift = mean(best, to) - mean(from, best);
    if (strongest < threshold(false_alarm / places, freedom()) || std::fabs(shift) < settings_.least_change)
      return;
    cuts_.push_back(best);
    split(from, best);
    split(best, to);
  }

  std::span<const double> ratios_;
  const Settings& settings_;
  double scatter_;
  std::vector<double> sums_;
  std::vector<std::size_t> cuts_;
};

}  // namespace

std::vector<Mark> find_marks(std::span<const MissionRatio> missions, const Settings& settings) {
  std::map<std::int64_t, std::vector<MissionRatio>> by_version;
  for (const MissionRatio& m : missions)
    if (m.usable()) by_version[m.model_version].push_back(m);
  std::vector<Mark> marks;
  for (auto& [version, group] : by_version) {
    std::ranges::stable_sort(group, {}, &MissionRatio::utime_us);
    std::vector<double> ratios(group.size());
    std::ranges::transform(group, ratios.begin(), &MissionRatio::ratio);
    Stretch stretch(ratios, settings);
    std::vector<std::size_t> cuts = stretch.cuts();
    for (std::size_t k = 0; k < cuts.size(); ++k) {
      const std::size_t from = k == 0 ? 0 : cuts[k - 1], cut = cuts[k],
                        to = k + 1 < cuts.size() ? cuts[k + 1] : group.size();
      Mark mark;
      mark.mission_key = group[cut].mission_key;
      mark.utime_us = group[cut].utime_us;
      mark.model_version = version;
      mark.before = stretch.mean(from, cut);
      mark.after = stretch.mean(cut, to);
      mark.missions = to - cut;
      const double half = threshold(0.05, stretch.freedom()) * stretch.error(cut - from, to - cut);
      mark.interval = {mark.after - mark.before - half, mark.after - mark.before + half};
      // Splitting further can bring two neighbours together again.
      if (std::fabs(mark.after - mark.before) >= settings.least_change) marks.push_back(mark);
    }
  }
  std::ranges::stable_sort(marks, {}, &Mark::utime_us);
  return marks;
}

}  // namespace joulecast::drift
