#include "server/metrics.h"

#include <prometheus/text_serializer.h>

#include <cstdio>
#include <cstdlib>
#include <map>

namespace joulecast {
namespace {

std::map<std::string, std::string> to_map(const Labels& labels) {
  return {labels.begin(), labels.end()};
}

void check_name(const std::string& name, bool is_counter) {
  bool good = (name.starts_with("joulecast_") || name.starts_with("process_")) &&
              name.ends_with("_total") == is_counter;
  for (const char c : name) good = good && ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_');
  if (good) return;
  std::fprintf(stderr, "metric name %s breaks the convention joulecast_<what>_<unit>[_total]\n",
               name.c_str());
  std::abort();
}

prometheus::MetricFamily family_of(const Metrics::Series& series) {
  const bool counter = series.name.ends_with("_total");
  check_name(series.name, counter);
  prometheus::MetricFamily family;
  family.name = series.name;
  family.help = series.help;
  family.type = counter ? prometheus::MetricType::Counter : prometheus::MetricType::Gauge;
  for (const auto& [labels, value] : series.rows) {
    prometheus::ClientMetric& metric = family.metric.emplace_back();
    for (const auto& [name, text] : labels) metric.label.push_back({name, text});
    (counter ? metric.counter.value : metric.gauge.value) = value;
  }
  return family;
}

}  // namespace

prometheus::Counter& Metrics::counter(const std::string& name, const std::string& help,
                                      const Labels& labels) {
  check_name(name, true);
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry_).Add(to_map(labels));
}

prometheus::Histogram& Metrics::histogram(const std::string& name, const std::string& help,
                                          const std::vector<double>& upper_bounds, const Labels& labels) {
  check_name(name, false);
  return prometheus::BuildHistogram().Name(name).Help(help).Register(registry_).Add(to_map(labels),
                                                                                    upper_bounds);
}

void Metrics::series(std::function<std::vector<Series>()> read) {
  const std::lock_guard lock(mutex_);
  readers_.push_back(std::move(read));
}

std::string Metrics::text() const {
  const std::lock_guard lock(mutex_);
  std::vector<prometheus::MetricFamily> families = registry_.Collect();
  for (const auto& read : readers_)
    for (const Series& series : read()) families.push_back(family_of(series));
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace joulecast
