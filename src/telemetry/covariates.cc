#include "telemetry/covariates.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "telemetry/codec.h"

namespace joulecast::telemetry {
namespace {

// Robot ids and the parts of covariate names have the same characters and the same length.
static_assert(max_covariate_name_length == max_robot_id_length);
bool is_part(std::string_view text) noexcept {
  return is_valid_robot_id(text);
}

bool same(double a, double b) noexcept {
  return a == b || (std::isnan(a) && std::isnan(b));
}

// Of a label 0 is as good as nothing: it does not hold.
bool says_something(std::string_view name, double value) noexcept {
  return !std::isnan(value) && !(is_label(name) && value == 0);
}

}  // namespace

bool is_valid_covariate_name(std::string_view name) noexcept {
  const std::size_t equals = name.find('=');
  return is_part(name.substr(0, equals)) &&
         (equals == std::string_view::npos || is_part(name.substr(equals + 1)));
}

bool is_label(std::string_view covariate_name) noexcept {
  return covariate_name.find('=') != std::string_view::npos;
}

std::vector<CovariateSeries> series_of(std::span<const CovariateChange> changes) {
  std::vector<CovariateSeries> all;
  std::map<std::string_view, std::vector<std::size_t>> of_name;
  for (std::size_t k = 0; k < changes.size(); ++k) {
    auto& places = of_name[changes[k].name];
    if (places.empty()) all.push_back({changes[k].name, {}, {}});
    places.push_back(k);
  }
  for (CovariateSeries& series : all) {
    auto& places = of_name[series.name];
    std::ranges::stable_sort(places, {}, [&](std::size_t k) { return changes[k].utime_us; });
    for (const std::size_t k : places) {
      if (!series.utime_us.empty() && series.utime_us.back() == changes[k].utime_us) {
        series.value.back() = changes[k].value;
        continue;
      }
      series.utime_us.push_back(changes[k].utime_us);
      series.value.push_back(changes[k].value);
    }
  }
  return all;
}

std::vector<CovariateChange> changes_of(std::span<const CovariateSeries> series) {
  std::vector<CovariateChange> changes;
  for (const CovariateSeries& one : series)
    for (std::size_t k = 0; k < one.utime_us.size(); ++k)
      changes.push_back({one.utime_us[k], one.name, one.value[k]});
  std::ranges::stable_sort(changes, {}, &CovariateChange::utime_us);
  return changes;
}

const CovariateSeries* find_series(std::span<const CovariateSeries> series, std::string_view name) {
  const auto found = std::ranges::find(series, name, &CovariateSeries::name);
  return found == series.end() ? nullptr : &*found;
}

double CovariateReader::at(std::int64_t utime_us) {
  if (series_ == nullptr) return unmeasured;
  while (next_ < series_->utime_us.size() && series_->utime_us[next_] <= utime_us) ++next_;
  return next_ == 0 ? unmeasured : series_->value[next_ - 1];
}

CovariateTracker::Verdict CovariateTracker::take(std::int64_t utime_us, const Covariate& covariate,
                                                 CovariateChange& change) {
  bool clock_set = false;
  const auto known = held_.find(covariate.name);
  if (known == held_.end()) {
    if (std::isnan(covariate.value)) return Verdict::repeat;
    if (held_.size() >= max_covariates) return Verdict::no_room;
    held_.emplace(covariate.name, Held{utime_us, covariate.value});
  } else {
    Held& held = known->second;
    clock_set = utime_us < held.utime_us - reorder_us_;
    if (utime_us < held.utime_us && !clock_set) return Verdict::late;
    if (same(held.value, covariate.value)) {
      held.utime_us = utime_us;
      return Verdict::repeat;
    }
    if (utime_us == held.utime_us) return Verdict::late;
    held = {utime_us, covariate.value};
  }
  change = {clock_set ? utime_us : std::max(utime_us, mission_start_us_), covariate.name, covariate.value};
  return Verdict::news;
}

std::vector<CovariateChange> CovariateTracker::begin_mission(std::int64_t start_utime_us) {
  mission_start_us_ = start_utime_us;
  std::erase_if(held_, [](const auto& entry) { return !says_something(entry.first, entry.second.value); });
  std::vector<CovariateChange> changes;
  for (const auto& [name, held] : held_)
    changes.push_back({std::max(held.utime_us, start_utime_us), name, held.value});
  return changes;
}

void CovariateTracker::resume(std::int64_t mission_start_utime_us, std::span<const CovariateChange> held) {
  mission_start_us_ = mission_start_utime_us;
  for (const CovariateChange& one : held) held_[one.name] = {one.utime_us, one.value};
}

}  // namespace joulecast::telemetry
