#include "drift/marks.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "drift/chance.h"

namespace joulecast::drift {
namespace {

// Values of one quantity since the last mark, cut where the two sides differ most.
struct Cut {
  std::size_t at = 0, places = 0;
  double before = 0, after = 0, error = 0, freedom = 0;  // standard error of the difference
  double t() const { return std::fabs(after - before) / error; }
};

std::optional<Cut> strongest_cut(std::span<const double> values, std::size_t least) {
  const std::size_t n = values.size();
  if (n < 2 * least) return std::nullopt;
  // About the first value, so that squares keep their digits.
  std::vector<double> sums(1), squares(1);
  for (const double v : values) {
    const double off = v - values[0];
    sums.push_back(sums.back() + off);
    squares.push_back(squares.back() + off * off);
  }
  std::optional<Cut> best;
  for (std::size_t at = least; at + least <= n; ++at) {
    const auto a = static_cast<double>(at), b = static_cast<double>(n - at);
    const double before = sums[at] / a, after = (sums[n] - sums[at]) / b;
    const double left = squares[at] - a * before * before,
                 right = squares[n] - squares[at] - b * after * after;
    // That of the side that scatters more: some missions with unlike loads are no other mass.
    const double variance = std::max({left / (a - 1), right / (b - 1), least_scatter * least_scatter});
    const Cut cut{at,
                  n - 2 * least + 1,
                  values[0] + before,
                  values[0] + after,
                  std::sqrt(variance * (1 / a + 1 / b)),
                  a + b - 2};
    if (!best || cut.t() > best->t()) best = cut;
  }
  return best;
}

// The change that these missions of one version, since the last mark, reveal, and the index of its mission.
std::optional<std::pair<std::size_t, Mark>> revealed(std::span<const MissionRatio> missions,
                                                     const Settings& settings) {
  std::optional<std::pair<std::size_t, Mark>> found;
  double strongest = 1;
  for (std::size_t q = 0; q < quantity_count; ++q) {
    std::vector<double> values;
    std::vector<std::size_t> from;
    for (std::size_t k = 0; k < missions.size(); ++k) {
      const double value = missions[k].ratios()[q];
      if (!std::isfinite(value)) continue;
      values.push_back(value);
      from.push_back(k);
    }
    const std::optional<Cut> cut = strongest_cut(values, settings.least_missions);
    if (!cut || !(std::fabs(cut->after - cut->before) >= settings.least_change)) continue;
    const auto looks = static_cast<double>(cut->places);
    const double share = quantity_count * looks * looks * (looks + 1);
    const double strength = cut->t() / threshold(false_alarm / share, cut->freedom);
    if (!(strength > strongest)) continue;
    strongest = strength;
    const double half = threshold(0.05, cut->freedom) * cut->error;
    const double change = cut->after - cut->before;
    const MissionRatio& first = missions[from[cut->at]];
    found = {from[cut->at], Mark{first.mission_key,
                                 first.utime_us,
                                 first.model_version,
                                 static_cast<Quantity>(q),
                                 cut->before,
                                 cut->after,
                                 {change - half, change + half},
                                 0}};
  }
  return found;
}

}  // namespace

std::vector<Mark> find_marks(std::span<const MissionRatio> missions, const Settings& settings) {
  std::map<std::int64_t, std::vector<MissionRatio>> by_version;
  for (const MissionRatio& m : missions)
    if (m.usable()) by_version[m.model_version].push_back(m);
  std::vector<Mark> marks;
  for (auto& [version, group] : by_version) {
    std::ranges::stable_sort(group, {}, &MissionRatio::utime_us);
    const std::span<const MissionRatio> all = group;
    std::size_t since = 0;
    for (std::size_t n = 1; n <= all.size(); ++n) {
      const auto found = revealed(all.subspan(since, n - since), settings);
      if (!found) continue;
      if (since > 0) marks.back().missions = found->first;
      since += found->first;
      marks.push_back(found->second);
    }
    if (since > 0) marks.back().missions = all.size() - since;
  }
  std::ranges::stable_sort(marks, {}, &Mark::utime_us);
  return marks;
}

}  // namespace joulecast::drift
