#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "drift/marks.h"
#include "forecast/outlook.h"
#include "forecast/robot_forecast.h"
#include "history/store.h"
#include "ingest/fleet_view.h"
#include "ingest/model_registry.h"

namespace joulecast::ingest {

using answers::RobotOutlook;

// The forecasts of all robots. Each is trained on its robot's missions as they end and shares its findings
// with its siblings (robots of equal body and motors). The legs of the latest missions are kept in the store
// under the topic "legs", from which a restarted daemon trains again. Any thread.
class Forecasts {
 public:
  static constexpr std::size_t kept_missions = 40;   // in the store
  static constexpr std::string_view topic = "legs";  // there

  explicit Forecasts(const history::Store& store);
  ~Forecasts();

  // Reads the robot's legs in the store, unless that was done or there is no model. of(), reach() and
  // forget() do it themselves; live_reach() and learn() never wait for the store.
  Result<void> read(const std::shared_ptr<const ModelInForce>& model);

  RobotOutlook of(std::shared_ptr<const ModelInForce> model);

  // Whether a starting daemon still reads the robots' missions; stated in each RobotOutlook until then.
  bool siblings_pending() const { return siblings_pending_; }
  void set_siblings_pending(bool pending) { siblings_pending_ = pending; }

  // Range and run time of a robot that continues its recent motion. NaN while its charge is unknown.
  forecast::Reach reach(const std::shared_ptr<const ModelInForce>& model, const RobotSnapshot& live);
  forecast::Reach live_reach(const std::shared_ptr<const ModelInForce>& model, const RobotSnapshot& live);

  // A mission ended. Returns what is to be stored.
  history::Learned learn(const std::shared_ptr<const ModelInForce>& model, forecast::PastMission mission);

  // The robot's last change, as the watch of the gap sees it.
  void set_change(const std::string& robot_id, const std::optional<drift::Mark>& change);

  // Another daemon has trained on the robot's missions: the legs in the store are to be read again.
  void learnt_elsewhere(const std::string& robot_id);

  // Removes the mission with this start and trains again on the rest. Empty: it was not used, or is not kept.
  std::optional<history::Learned> forget(const std::shared_ptr<const ModelInForce>& model,
                                         std::int64_t start_utime_us);

 private:
  struct Entry;
  struct Kind {
    std::map<std::string, std::shared_ptr<const std::array<forecast::OwnFinding, forecast::subject_count>>>
        findings;
    std::int64_t missions = 0;  // used for training by all
  };

  Entry& entry(const std::string& robot_id);
  static history::Learned document_of(const Entry& entry);
  void bring_up(Entry& entry, const std::shared_ptr<const ModelInForce>& model);
  void begin(Entry& entry);
  bool drop(Entry& entry, std::int64_t start_utime_us);
  void borrow(Entry& entry);
  void lend(Entry& entry);

  const history::Store& store_;
  std::atomic<bool> siblings_pending_ = false;
  std::mutex mutex_;  // of the maps; taken after an entry's own
  std::map<std::string, std::unique_ptr<Entry>, std::less<>> entries_;
  std::map<std::string, Kind, std::less<>> kinds_;
};

// Stored form of past missions, and back; nothing when the text is not of that form.
std::string legs_json(const std::deque<forecast::PastMission>& missions);
std::optional<std::deque<forecast::PastMission>> legs_from_json(const std::string& text);

}  // namespace joulecast::ingest
