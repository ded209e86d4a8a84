#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/host_clock.h"
#include "ingest/forecasts.h"
#include "ingest/pipeline.h"
#include "ingest/signature_gate.h"
#include "telemetry/lcm_link.h"

namespace joulecast::ingest {

struct IngestOptions {
  std::string lcm_url;
  telemetry::ListenOptions listen;
  std::size_t queue_messages = 200'000;          // bound between receiving and accounting
  std::chrono::milliseconds publish_period{50};  // of accounting; snapshots are no older than this
  std::chrono::milliseconds energy_state_period{1000};
  SignatureOptions signatures;
  SessionSettings session;
  std::size_t max_unknown_robots = 100;
};

struct IngestStatus {
  std::size_t queue_messages = 0;
  std::uint64_t receive_ticks = 0;  // turns of each loop, several a second: for the watchdog
  std::uint64_t account_ticks = 0;
  bool receiving = false;
  std::string error;      // why not receiving
  std::string key_error;  // why the robots' keys are not those of the file; empty: they are
};

// The two ingest threads: one receives from LCM, guards, decodes and queues; the other runs the pipeline over
// the queue once every publish period, ticks it, and publishes each live robot's ENERGY_STATE.
class IngestService {
 public:
  // `keeping`: as Pipeline's.
  IngestService(IngestOptions options, const ModelRegistry& models, Forecasts& forecasts,
                SessionOutputs outputs, Keeping* keeping = nullptr);
  ~IngestService();

  // Recovers open missions, opens LCM and starts the threads.
  Result<void> start();
  // Stops receiving, accounts for queued messages, checkpoints all missions.
  void stop();

  IngestStatus status() const;

  // Queues a stored request, which is ignored if another daemon keeps the robot. Any thread.
  void request_mission(const std::string& robot_id, const MissionRequest& request);

 private:
  using Clock = std::chrono::steady_clock;

  void receive();
  void report_dropped(std::uint64_t dropped);
  void refresh_keys();
  void account();
  void on_clock_step(std::int64_t step_us);
  void publish_energy_states();

  IngestOptions options_;
  const ModelRegistry& models_;
  Forecasts& forecasts_;
  SessionOutputs outputs_;
  SignatureGate signatures_;  // the receiver's
  Keeping* keeping_;
  Pipeline pipeline_;
  ClockSteps clock_steps_;  // the accountant's
  std::unique_ptr<telemetry::LcmLink> link_;
  std::vector<InboundMessage> batch_;  // the receiver's, as the next two
  std::uint64_t unreported_ = 0;       // messages left out
  Clock::time_point next_report_{};
  mutable std::mutex mutex_;
  std::condition_variable drains_;
  std::vector<InboundMessage> queue_;
  std::string error_, key_error_;
  bool draining_ = false;
  std::atomic<bool> running_ = false, receiving_ = false;
  std::atomic<std::uint64_t> receive_ticks_ = 0, account_ticks_ = 0;
  std::thread receiver_, accountant_;
};

}  // namespace joulecast::ingest
