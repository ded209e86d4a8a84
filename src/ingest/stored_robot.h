#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/error.h"
#include "history/commands.h"
#include "history/store.h"
#include "ingest/counters.h"
#include "ingest/inbound_message.h"
#include "ingest/model_registry.h"
#include "signals/gaps.h"

namespace joulecast::ingest {

inline constexpr std::string_view charge_topic = "charge";  // memory of the charge watch in the store

// A tail of stored samples begins this long before the end of the open mission, for the filters of meter and
// climb, and has at least this many samples, for the sample period (signals/gaps.h) and samples not settled.
inline constexpr std::int64_t tail_us = 5'000'000;
inline constexpr std::size_t tail_samples = 2 * signals::steps_before;

// What the store has of a robot, from which its session continues.
struct StoredRobot {
  std::string robot_id;
  std::optional<history::ResumeState> state = {};
  std::string charge_memory = {}, refinement_memory = {};
  std::vector<history::Mission> ended = {};        // the latest, newest first
  std::vector<Contradiction> contradictions = {};  // of the last of these that made its accounts wrong
  std::optional<history::Mission> open = {};
  std::vector<signals::Sample> tail = {};                       // the end of the open one's, in order of time
  Result<std::shared_ptr<const ModelInForce>> model = nullptr;  // that the open one was announced under
  std::vector<MissionRequest> requests = {};                    // oldest first
  history::Epoch epoch = 0;                                     // of the lease, in a cluster
};

Result<StoredRobot> read_stored_robot(const history::Store& store, const std::string& robot_id);

// The contradictions in the findings of the robot's last mission that made its accounts wrong; they were
// reported at that mission's end. Empty if it had none, or if the store cannot be read.
std::vector<Contradiction> stored_contradictions(const history::Store& store, const std::string& robot_id);

// Reads robots for the accounting thread, which does not wait for the store: in a thread of its own, one
// after the other, each again until it succeeds.
class RobotReader {
 public:
  using Read = std::function<Result<StoredRobot>(const std::string& robot_id)>;
  explicit RobotReader(Read read) : read_(std::move(read)) {}

  void start() {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  // What was not read yet is read by take().
  void stop() { thread_ = {}; }

  void want(const std::string& robot_id, history::Epoch epoch);
  // Those read since the last call. Without the thread they are read now.
  std::vector<StoredRobot> take();

 private:
  struct Wanted {
    std::string robot_id;
    history::Epoch epoch = 0;
  };
  void run(const std::stop_token& stop);
  // False if the store could not be read; then the robot is wanted again.
  bool read_next(std::unique_lock<std::mutex>& lock);

  const Read read_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<Wanted> wanted_;
  std::vector<StoredRobot> done_;
  std::jthread thread_;
};

}  // namespace joulecast::ingest
