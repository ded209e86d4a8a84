#include "signals/covariates.h"

#include <algorithm>
#include <map>

namespace joulecast::signals {

// The parts of a covariate's name have the characters and the length of a robot id.
bool is_valid_covariate_name(std::string_view name) noexcept {
  const std::size_t equals = name.find('=');
  return is_valid_robot_id(name.substr(0, equals)) &&
         (equals == std::string_view::npos || is_valid_robot_id(name.substr(equals + 1)));
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

}  // namespace joulecast::signals
