#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "history/store.h"
#include "history/writer.h"
#include "ingest/model_registry.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/diagnosis/drift_view.h"

namespace joulecast::server {

struct WatchOptions {
  double period_s = 3600;                                   // 0: no watch
  std::set<std::string> robots;                             // empty: all
  std::function<bool(const std::string& robot_id)> is_own;  // of the daemons of a cluster; empty: all are
  bool diagnose = true;  // a drift starts a diagnosis of the missions since
};

struct WatchCounts {
  std::uint64_t rounds = 0;
  std::uint64_t drifts = 0;      // found since the start
  std::size_t drifting = 0;      // robots without a model adopted since their newest mark
  std::size_t standing_out = 0;  // robots that deviate from their kind
  double ratio_min = 1, ratio_median = 1, ratio_max = 1;  // of the robots' newest missions; NaN: none
  std::map<std::string, double> ratios;                   // of the robots that are compared with their kind
};

// Looks at every robot's missions periodically: a change of measured over modelled energy is an event
// "gap_drift" and, if enabled, starts a diagnosis of the missions since. Its end is an event "gap_diagnosed"
// with the cause: wear, floor, battery, load or sensors. A robot that starts to spend more or less than its
// kind is an event "gap_sibling".
class GapWatch {
 public:
  GapWatch(const history::Store& store, history::Writer& writer, const ingest::ModelRegistry& models,
           const DriftView& drift, DiagnosisService& diagnoses, std::function<std::int64_t()> now_utime_us,
           const WatchOptions& options, std::function<void(const Error&)> on_error);
  ~GapWatch();
  GapWatch(const GapWatch&) = delete;
  GapWatch& operator=(const GapWatch&) = delete;

  void start();
  void stop();

  // One look at all robots, as the schedule does.
  void look();
  // To be called with ended diagnoses.
  void on_diagnosis(const history::DiagnosisRecord& diagnosis);

  WatchCounts counts() const;

 private:
  Result<void> look_at(const ingest::ModelInForce& model, WatchCounts& counts);
  Result<void> compare_kinds(WatchCounts& counts);
  Result<void> remember(const std::string& robot_id, std::int64_t announced_utime_us, bool stood_out);
  bool watches(const std::string& robot_id) const;
  bool is_own(const std::string& robot_id) const;
  void record(const std::string& robot_id, const std::string& kind, std::string detail_json);

  const history::Store& store_;
  history::Writer& writer_;
  const ingest::ModelRegistry& models_;
  const DriftView& drift_;
  DiagnosisService& diagnoses_;
  std::function<std::int64_t()> now_utime_us_;
  WatchOptions options_;
  std::function<void(const Error&)> on_error_;
  std::mutex looking_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  WatchCounts counts_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace joulecast::server
