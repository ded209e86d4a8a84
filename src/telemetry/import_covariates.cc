#include "telemetry/import_covariates.h"

#include <algorithm>
#include <cmath>

namespace joulecast::telemetry {
namespace {

bool same_value(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

// One '_' for every character that a label may not have; bytes that continue a character of UTF-8 are part of
// it.
std::string label_of(std::string_view text) {
  std::string label;
  for (const char c : text) {
    const bool continues = (static_cast<unsigned char>(c) & 0xC0) == 0x80;
    if (!continues) label += signals::is_valid_covariate_name(std::string_view(&c, 1)) ? c : '_';
  }
  return label;
}

}  // namespace

Result<void> ImportedCovariates::set_label(const std::string& quantity, std::string_view text) {
  const std::string label = label_of(text);
  if (label.size() > signals::max_covariate_name_length)
    return fail(Fault::corrupt, "",
                "is longer than the " + std::to_string(signals::max_covariate_name_length) +
                    " characters that a label may have");
  const auto& labels = labels_[quantity];
  if (!label.empty() && labels.size() == max_import_labels &&
      std::ranges::find(labels, label) == labels.end())
    return fail(Fault::corrupt, "",
                "is one label of " + quantity + " too many; at most " + std::to_string(max_import_labels) +
                    " are allowed");
  labelled_[quantity].now = label;
  return {};
}

void ImportedCovariates::commit(std::int64_t utime_us) {
  for (auto& [name, quantity] : quantities_)
    if (!same_value(quantity.now,
                    quantity.changes.empty() ? signals::unmeasured : quantity.changes.back().second))
      quantity.changes.emplace_back(utime_us, quantity.now);
  for (auto& [name, quantity] : labelled_) {
    if (quantity.now == (quantity.changes.empty() ? "" : quantity.changes.back().second)) continue;
    quantity.changes.emplace_back(utime_us, quantity.now);
    auto& labels = labels_[name];
    if (!quantity.now.empty() && std::ranges::find(labels, quantity.now) == labels.end())
      labels.push_back(quantity.now);
  }
}

Result<std::vector<signals::CovariateSeries>> ImportedCovariates::finish() {
  std::vector<signals::CovariateSeries> all;
  const auto add = [&](const std::string& name, const auto& changes, const auto& value_of) {
    signals::CovariateSeries series{name, {}, {}};
    for (const auto& [utime_us, content] : changes) {
      const double value = value_of(content);
      if (!series.value.empty() && same_value(series.value.back(), value)) continue;
      series.utime_us.push_back(utime_us);
      series.value.push_back(value);
    }
    if (!series.value.empty()) all.push_back(std::move(series));
  };
  for (auto& [name, quantity] : quantities_) {
    add(name, quantity.changes, [](double value) { return value; });
    quantity.changes.clear();
  }
  for (auto& [name, quantity] : labelled_) {
    for (const std::string& label : labels_[name])
      add(name + "=" + label, quantity.changes, [&](const std::string& present) {
        return present.empty() ? signals::unmeasured : present == label ? 1.0 : 0.0;
      });
    quantity.changes.clear();
  }
  std::ranges::stable_sort(all, {}, [](const auto& series) { return series.utime_us.front(); });
  if (all.size() > signals::max_covariates)
    return invalid("covariates", "are " + std::to_string(all.size()) +
                                     " with every label; a recording has at most " +
                                     std::to_string(signals::max_covariates));
  return all;
}

}  // namespace joulecast::telemetry
