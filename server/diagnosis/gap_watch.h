#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "history/store.h"
#include "history/writer.h"
#include "ingest/forecasts.h"
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

// The result of the newest look at one robot.
struct WatchFinding {
  std::string kind;                               // robot/robot_fields.h
  drift::RobotRatios newest;                      // its newest missions under the model in force
  std::optional<drift::Mark> change;              // its newest mark, under any model
  std::optional<drift::SiblingRatio> among_kind;  // absent with too few missions
};

// Checks the missions of all robots at the start and once a period, and those of a robot when its mission has
// ended. A change under the model in force is an event "gap_drift" and, where the options permit it,
// starts a diagnosis of the missions since the change, whose end is an event "gap_diagnosed" with its likely
// cause: wear, floor, battery, load or sensors. A robot that comes to use more or less energy than its kind
// is an event "gap_sibling".
class GapWatch {
 public:
  GapWatch(Parts parts, ingest::Forecasts& forecasts, DiagnosisService& diagnoses,
           const WatchOptions& options)
      : parts_(std::move(parts)), forecasts_(forecasts), diagnoses_(diagnoses), options_(options) {}

  void start();
  void stop() { thread_ = {}; }

  // Checks all robots, as the schedule does.
  void look();
  // To be called when a mission has ended; does not wait.
  void mission_ended(const std::string& robot_id);
  // The robot's last change, as of the last look.
  std::optional<drift::Mark> last_change(const std::string& robot_id) const;
  // To be called with ended diagnoses.
  void on_diagnosis(const history::DiagnosisRecord& diagnosis);

  WatchCounts counts() const;
  // By robot id.
  std::map<std::string, WatchFinding> findings() const;

 private:
  void run(const std::stop_token& stop);
  void look_at(const std::vector<std::shared_ptr<const ingest::ModelInForce>>& models);
  Result<WatchFinding> find(const ingest::ModelInForce& model) const;
  Result<void> announce_drift(const std::string& robot_id, const drift::Mark& mark);
  Result<void> announce_sibling(const drift::SiblingRatio& sibling, std::size_t compared_with);
  Result<void> remember(const std::string& robot_id, std::int64_t announced_utime_us, bool stood_out);
  bool watches(const std::string& robot_id) const;
  bool is_own(const std::string& robot_id) const { return !options_.is_own || options_.is_own(robot_id); }
  void record(const std::string& robot_id, const std::string& kind, std::string detail_json);

  const Parts parts_;
  ingest::Forecasts& forecasts_;
  DiagnosisService& diagnoses_;
  WatchOptions options_;
  std::mutex looking_;
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  std::map<std::string, WatchFinding> findings_;
  std::uint64_t rounds_ = 0, drifts_ = 0;
  std::set<std::string> ended_;  // robots whose missions ended since the last look
  std::jthread thread_;
};

}  // namespace joulecast::server
