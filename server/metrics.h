#pragma once

#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// Prometheus metrics. Names are joulecast_<what>_<base unit>[_total]; a label's values are fixed when the
// metric is made, so that no client can make their number grow. Counters and histograms are usable from any
// thread, and valid as long as the Metrics they come from.
namespace joulecast {

using Labels = std::vector<std::pair<std::string, std::string>>;

class Metrics {
 public:
  // The same name and labels give the same metric. A name that violates the convention aborts.
  prometheus::Counter& counter(const std::string& name, const std::string& help, const Labels& labels = {});
  prometheus::Histogram& histogram(const std::string& name, const std::string& help,
                                   const std::vector<double>& upper_bounds, const Labels& labels = {});

  // Metrics that are read again before each text(): counters where the name ends in _total, otherwise gauges.
  // Values of labels that are left out disappear; the reader bounds their number and must be thread-safe.
  // Names as above, or process_<what>, Prometheus's convention for all programs.
  struct Series {
    std::string name;
    std::string help;
    std::vector<std::pair<Labels, double>> rows = {};

    Series(std::string metric, std::string meaning) : name(std::move(metric)), help(std::move(meaning)) {}
    // Of one value without labels.
    template <class Number>
    Series(std::string metric, std::string meaning, Number value)
        : name(std::move(metric)), help(std::move(meaning)), rows{{{}, static_cast<double>(value)}} {}
  };
  // What `read` refers to must outlive the last text().
  void series(std::function<std::vector<Series>()> read);

  // Prometheus text exposition format 0.0.4.
  std::string text() const;

  static std::string_view content_type() { return "text/plain; version=0.0.4; charset=utf-8"; }

 private:
  prometheus::Registry registry_;
  mutable std::mutex mutex_;
  std::vector<std::function<std::vector<Series>()>> readers_;
};

}  // namespace joulecast
