#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace prometheus {
class Counter;
class Gauge;
class Histogram;
}  // namespace prometheus

// Prometheus metrics behind handles. Names are joulecast_<what>_<base unit>[_total]; a label's values are
// fixed when the metric is made, so that no client can make their number grow. Handles are small, copyable,
// usable from any thread, and valid as long as the Metrics they come from.
namespace joulecast {

class Counter {
 public:
  Counter() = default;
  void add(double amount = 1) const;
  // Raises the counter to an external total; smaller totals are ignored, since counters never fall.
  void raise_to(double total) const;

 private:
  friend class Metrics;
  explicit Counter(prometheus::Counter* counter) : counter_(counter) {}
  prometheus::Counter* counter_ = nullptr;  // null: counts nothing
};

class Gauge {
 public:
  Gauge() = default;
  void set(double value) const;

 private:
  friend class Metrics;
  explicit Gauge(prometheus::Gauge* gauge) : gauge_(gauge) {}
  prometheus::Gauge* gauge_ = nullptr;
};

class Histogram {
 public:
  Histogram() = default;
  void observe(double value) const;

 private:
  friend class Metrics;
  explicit Histogram(prometheus::Histogram* histogram) : histogram_(histogram) {}
  prometheus::Histogram* histogram_ = nullptr;
};

using Labels = std::vector<std::pair<std::string, std::string>>;

class Metrics {
 public:
  Metrics();
  ~Metrics();

  // The same name and labels give the same metric. A name that violates the convention aborts.
  Counter counter(const std::string& name, const std::string& help, const Labels& labels = {});
  Gauge gauge(const std::string& name, const std::string& help, const Labels& labels = {});
  Histogram histogram(const std::string& name, const std::string& help,
                      const std::vector<double>& upper_bounds, const Labels& labels = {});
  // One counter for each value of a label, all present from the start at zero, in the order of the values.
  std::vector<Counter> counters(const std::string& name, const std::string& help, const std::string& label,
                                const std::vector<std::string>& values);

  // Called before each text() to set gauges from other state. Must be thread-safe.
  void before_scrape(std::function<void()> refresh);

  // Metrics with changing label values, all read again before each text(); values that are left out
  // disappear. The reader bounds their number and must be thread-safe. Names as above, or process_<what>,
  // Prometheus's convention for all programs.
  struct Series {
    std::string name;
    std::string help;
    std::vector<std::pair<Labels, double>> rows = {};
  };
  void series(std::function<std::vector<Series>()> read);

  // A metric of a part's status: a counter where the name ends in _total, otherwise a gauge.
  template <class Status>
  struct Row {
    Row(std::string metric, std::string meaning, std::function<double(const Status&)> of)
        : name(std::move(metric)), help(std::move(meaning)), value(std::move(of)) {}
    template <class T>
    Row(std::string metric, std::string meaning, T Status::*member)
        : Row(std::move(metric), std::move(meaning),
              [member](const Status& s) { return static_cast<double>(s.*member); }) {}
    std::string name, help;
    std::function<double(const Status&)> value;
  };
  // Metrics of a status that is read once before each text(); where there is none, the last values stay.
  template <class Status>
  void rows(std::function<std::optional<Status>()> read, const std::vector<Row<Status>>& table) {
    std::vector<std::function<void(const Status&)>> all;
    for (const Row<Status>& row : table) {
      if (row.name.ends_with("_total"))
        all.push_back(
            [to = counter(row.name, row.help), of = row.value](const Status& s) { to.raise_to(of(s)); });
      else
        all.push_back([to = gauge(row.name, row.help), of = row.value](const Status& s) { to.set(of(s)); });
    }
    before_scrape([read = std::move(read), all = std::move(all)] {
      const std::optional<Status> status = read();
      if (!status) return;
      for (const auto& put : all) put(*status);
    });
  }

  // Prometheus text exposition format 0.0.4.
  std::string text() const;

  // Content type of text().
  static std::string_view content_type() { return "text/plain; version=0.0.4; charset=utf-8"; }

  // Upper bounds for request durations, from 50 µs to 10 s.
  static const std::vector<double>& request_seconds();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace joulecast
