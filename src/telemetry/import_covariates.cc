#include "telemetry/import_covariates.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace joulecast::telemetry {
namespace {

// One '_' for every character that a label may not have; bytes that continue a character of UTF-8 are part of
// it.
std::string label_of(std::string_view text) {
  std::string label;
  for (const char c : text) {
    const bool continues = (static_cast<unsigned char>(c) & 0xC0) == 0x80;
    if (!continues) label += signals::is_valid_covariate_name(std::string_view(&c, 1)) ? c : '_';
  }
  return label.empty() ? "_" : label;
}

}  // namespace

void ImportedCovariates::set(const std::string& name, double value) {
  const auto [entry, is_new] = now_.insert_or_assign(name, value);
  if (is_new) names_.push_back(name);
}

Result<void> ImportedCovariates::set_label(const std::string& quantity, std::string_view text) {
  const std::string label = label_of(text);
  if (label.size() > signals::max_covariate_name_length)
    return fail(Fault::corrupt, "",
                "is longer than the " + std::to_string(signals::max_covariate_name_length) +
                    " characters that a label may have");
  const std::string name = quantity + "=" + label;
  Labels& labels = labels_[quantity];
  labels.known = true;
  if (std::ranges::find(labels.names, name) == labels.names.end()) {
    if (labels.names.size() == max_import_labels)
      return fail(Fault::corrupt, "",
                  "is one label of " + quantity + " too many; at most " + std::to_string(max_import_labels) +
                      " are allowed");
    labels.names.push_back(name);
  }
  for (const std::string& other : labels.names) set(other, other == name ? 1 : 0);
  return {};
}

void ImportedCovariates::forget_labels(const std::string& quantity) {
  Labels& labels = labels_[quantity];
  labels.known = false;
  for (const std::string& name : labels.names) set(name, signals::unmeasured);
}

void ImportedCovariates::commit(std::int64_t utime_us) {
  for (const std::string& name : names_) {
    const double value = now_.at(name);
    const auto before = committed_.find(name);
    const double last = before == committed_.end() ? signals::unmeasured : before->second;
    if (value == last || (std::isnan(value) && std::isnan(last))) continue;
    changes_.push_back({utime_us, name, value});
    committed_[name] = value;
  }
  for (auto& [quantity, labels] : labels_)
    if (labels.known && labels.first_utime_us < 0) labels.first_utime_us = utime_us;
}

ImportedCovariates ImportedCovariates::next_mission() const {
  ImportedCovariates next = *this;
  next.committed_.clear();
  next.changes_.clear();
  for (auto& [quantity, labels] : next.labels_) labels.first_utime_us = -1;
  return next;
}

Result<std::vector<signals::CovariateSeries>> ImportedCovariates::finish() {
  std::vector<signals::CovariateChange> before;
  for (const auto& [quantity, labels] : labels_) {
    for (const std::string& name : labels.names) {
      const auto first = std::ranges::find(changes_, name, &signals::CovariateChange::name);
      if (first != changes_.end() && first->utime_us > labels.first_utime_us)
        before.push_back({labels.first_utime_us, name, 0});
    }
  }
  changes_.insert(changes_.end(), before.begin(), before.end());
  std::ranges::stable_sort(changes_, {}, &signals::CovariateChange::utime_us);
  std::vector<signals::CovariateSeries> series = signals::series_of(changes_);
  if (series.size() > signals::max_covariates)
    return invalid("covariates", "are " + std::to_string(series.size()) +
                                     " with every label; a recording has at most " +
                                     std::to_string(signals::max_covariates));
  return series;
}

}  // namespace joulecast::telemetry
