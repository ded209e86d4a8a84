#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "gap/drift.h"
#include "history/store.h"
#include "history/writer.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/ingest/model_registry.h"

namespace joulecast::server {

struct WatchOptions {
  double period_s = 3600;          // 0: no watch
  std::set<std::string> robots;    // empty: all
  std::size_t max_missions = 500;  // of each robot, newest first
  bool diagnose = true;            // a drift starts a diagnosis of the missions since
  gap::DriftSettings drift;
};

struct WatchCounts {
  std::uint64_t rounds = 0;
  std::uint64_t drifts = 0;      // found since the start
  std::size_t drifting = 0;      // robots whose newest mark no model adopted since has answered
  std::size_t standing_out = 0;  // robots that stand out among their kind
  double ratio_min = 1, ratio_median = 1, ratio_max = 1;  // of the robots' newest missions; NaN: none
};

// The finished missions of a robot that measured energy, as the meter accounted them, newest `limit`, oldest
// first.
Result<std::vector<gap::MissionRatio>> mission_ratios(const history::Store& store,
                                                      const std::string& robot_id, std::size_t limit);

// Start of the first mission after the robot's last change of consumption under this version of its model, as
// far as its newest `limit` missions show one.
std::optional<std::int64_t> last_drift(const history::Store& store, const std::string& robot_id,
                                       std::int64_t version, std::size_t limit);

// Robots whose files agree in all but their id, idle power and effects: one kind.
std::vector<std::string> robots_of_kind(const ModelRegistry& models, const std::string& robot_id);

// Looks at every robot's missions from time to time: a change of measured over modelled energy is an event
// "gap_drift" and, when asked for, starts a diagnosis of the missions since, whose end is an event
// "gap_diagnosed" that says what it blames: wear, floor, battery, load or sensors. A robot that comes to
// spend more or less than its kind is an event "gap_sibling".
class GapWatch {
 public:
  GapWatch(const history::Store& store, history::Writer& writer, const ModelRegistry& models,
           DiagnosisService& diagnoses, std::function<std::int64_t()> now_utime_us,
           const WatchOptions& options, std::function<void(const Error&)> on_error);
  ~GapWatch();
  GapWatch(const GapWatch&) = delete;
  GapWatch& operator=(const GapWatch&) = delete;

  void start();
  void stop();

  // One look at all robots, as the schedule does.
  void look();
  // To be told of ended diagnoses.
  void on_diagnosis(const history::DiagnosisRecord& diagnosis);

  WatchCounts counts() const;

 private:
  void look_at(const std::string& robot_id, const std::vector<gap::MissionRatio>& missions,
               WatchCounts& counts);
  void record(const std::string& robot_id, const std::string& kind, std::string detail_json);

  const history::Store& store_;
  history::Writer& writer_;
  const ModelRegistry& models_;
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
