#include "telemetry/covariate_tracker.h"

#include <algorithm>
#include <cmath>

namespace joulecast::telemetry {
namespace {

// Of a label 0 is as good as nothing: it does not hold.
bool says_something(std::string_view name, double value) noexcept {
  return !std::isnan(value) && !(signals::is_label(name) && value == 0);
}

}  // namespace

CovariateTracker::Verdict CovariateTracker::take(std::int64_t utime_us, const signals::Covariate& covariate,
                                                 signals::CovariateChange& change) {
  bool clock_set = false;
  const auto known = held_.find(covariate.name);
  if (known == held_.end()) {
    if (std::isnan(covariate.value)) return Verdict::repeat;
    if (held_.size() >= signals::max_covariates) return Verdict::no_room;
    held_.emplace(covariate.name, Held{utime_us, covariate.value});
  } else {
    Held& held = known->second;
    clock_set = utime_us < held.utime_us - reorder_us;
    if (utime_us < held.utime_us && !clock_set) return Verdict::late;
    if (signals::same(held.value, covariate.value)) {
      held.utime_us = utime_us;
      return Verdict::repeat;
    }
    if (utime_us == held.utime_us) return Verdict::late;
    held = {utime_us, covariate.value};
  }
  change = {clock_set ? utime_us : std::max(utime_us, mission_start_us_), covariate.name, covariate.value};
  return Verdict::news;
}

std::vector<signals::CovariateChange> CovariateTracker::begin_mission(std::int64_t start_utime_us) {
  mission_start_us_ = start_utime_us;
  std::erase_if(held_, [](const auto& entry) { return !says_something(entry.first, entry.second.value); });
  std::vector<signals::CovariateChange> changes;
  for (const auto& [name, held] : held_)
    changes.push_back({std::max(held.utime_us, start_utime_us), name, held.value});
  return changes;
}

std::string CovariateTracker::label_of(std::string_view quantity) const {
  const std::string prefix = std::string(quantity).append("=");
  std::string label;
  std::int64_t newest_us = INT64_MIN;
  for (auto at = held_.lower_bound(prefix); at != held_.end() && at->first.starts_with(prefix); ++at) {
    if (!says_something(at->first, at->second.value) || at->second.utime_us <= newest_us) continue;
    label = at->first.substr(prefix.size());
    newest_us = at->second.utime_us;
  }
  return label;
}

void CovariateTracker::resume(std::int64_t mission_start_utime_us,
                              std::span<const signals::CovariateChange> held) {
  mission_start_us_ = mission_start_utime_us;
  for (const signals::CovariateChange& one : held) held_[one.name] = {one.utime_us, one.value};
}

}  // namespace joulecast::telemetry
