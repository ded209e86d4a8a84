#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "energy/meter.h"
#include "forecast/robot_forecast.h"
#include "history/commands.h"
#include "history/store.h"
#include "ingest/charge_watch.h"
#include "ingest/contradiction_watch.h"
#include "ingest/counters.h"
#include "ingest/covariate_watch.h"
#include "ingest/fleet_view.h"
#include "ingest/inbound_message.h"
#include "ingest/model_registry.h"
#include "ingest/open_mission.h"
#include "ingest/refinement_watch.h"
#include "ingest/stored_robot.h"
#include "signals/gaps.h"
#include "signals/sample.h"
#include "telemetry/impossible.h"
#include "telemetry/mission_tracker.h"
#include "telemetry/sequence_tracker.h"

namespace joulecast::ingest {

// Puts one robot's samples back into the order of their sequence numbers: behind a hole samples wait for
// those that are missing, for `window_us` of the host's clock at most. In a stream without holes nothing
// waits. Samples older than the last one that was passed on, and restarts of the sequence, pass immediately;
// SequenceTracker classifies them.
class SampleOrder {
 public:
  using Sink = std::function<void(const signals::Sample&)>;

  SampleOrder(std::int64_t window_us, Sink sink) : window_us_(window_us), sink_(std::move(sink)) {}

  // Goes on after a sample that was passed on elsewhere; before the first.
  void start_after(std::int64_t sequence, std::int64_t utime_us) {
    next_ = sequence + 1;
    newest_utime_us_ = utime_us;
  }
  // False: a duplicate of one that waits.
  bool take(const signals::Sample& sample, std::int64_t host_utime_us) {
    release(host_utime_us);
    const std::int64_t step = sample.sequence - next_;  // neither is negative
    if (next_ < 0 || step == 0 || window_us_ == 0) {
      pass(sample);
      if (!waiting_.empty() && waiting_.begin()->first == next_) pass_run();
      return true;
    }
    if (step < 0) {
      const std::int64_t newest_us =
          waiting_.empty() ? newest_utime_us_ : waiting_.rbegin()->second.sample.utime_us;
      const bool restart =
          sample.utime_us > newest_us || sample.utime_us < newest_utime_us_ - telemetry::backward_jump_us;
      if (restart) {
        flush();
        pass(sample);
      } else {
        sink_(sample);
      }
      return true;
    }
    if (step > longest_hole) {
      flush();
      pass(sample);
      return true;
    }
    if (waiting_.empty()) since_us_ = host_utime_us;
    const auto [place, fresh] = waiting_.try_emplace(sample.sequence, Waiting{sample, host_utime_us});
    if (!fresh && place->second.sample.utime_us == sample.utime_us) return false;
    if (!fresh) {
      flush();
      sink_(sample);
    }
    if (waiting_.size() > capacity) pass_run();
    return true;
  }
  // Passes on the samples that have waited long enough.
  void release(std::int64_t host_utime_us) {
    since_us_ = std::min(since_us_, host_utime_us);  // the host's clock was set back
    while (!waiting_.empty() && host_utime_us - since_us_ >= window_us_) pass_run();
  }
  // Passes all on.
  void flush() {
    while (!waiting_.empty()) pass_run();
  }

 private:
  static constexpr std::size_t capacity = 256;
  static constexpr std::int64_t longest_hole = 1000;  // a larger leap is no reordering

  struct Waiting {
    signals::Sample sample;
    std::int64_t host_utime_us = 0;
  };

  void pass(const signals::Sample& sample) {
    next_ = sample.sequence + 1;
    newest_utime_us_ = sample.utime_us;
    sink_(sample);
  }
  // Passes on the first that waits and all that follow it without a hole.
  void pass_run() {
    next_ = waiting_.begin()->first;
    while (!waiting_.empty() && waiting_.begin()->first == next_) {
      const signals::Sample sample = waiting_.begin()->second.sample;
      waiting_.erase(waiting_.begin());
      pass(sample);
    }
    if (waiting_.empty()) return;
    since_us_ = std::ranges::min_element(waiting_, {}, [](const auto& each) {
                  return each.second.host_utime_us;
                })->second.host_utime_us;
  }

  std::int64_t window_us_;
  Sink sink_;
  std::map<std::int64_t, Waiting> waiting_;  // by sequence number
  std::int64_t since_us_ = 0;                // when the first of those that wait came
  std::int64_t next_ = -1;                   // the number expected; -1: none yet
  std::int64_t newest_utime_us_ = 0;         // of those passed on
};

// Rate limit of a robot's mission events: a token bucket that is refilled by time and by samples, because
// recordings are replayed faster than they were made.
class EventAllowance {
 public:
  explicit EventAllowance(double rate_hz) : rate_hz_(rate_hz) {}

  void earn_by_sample() { earn(a_sample); }

  // Takes one event; returns false if the allowance is used up.
  bool spend(std::int64_t host_utime_us) {
    earn(1e-6 * static_cast<double>(std::max<std::int64_t>(0, host_utime_us - earned_utime_us_)) * rate_hz_);
    earned_utime_us_ = host_utime_us;
    if (left_ < 1) return false;
    --left_;
    return true;
  }

  void give_back() { ++left_; }

 private:
  static constexpr double at_once = 100, a_sample = 0.2;

  void earn(double events) { left_ = std::min(at_once, left_ + events); }

  double rate_hz_;
  double left_ = at_once;
  std::int64_t earned_utime_us_ = 0;  // host's, when it was last earned with time
};

// Log lines of a robot's faults: the first of a kind, then one in ten minutes at most with the number since.
class FaultLog {
 public:
  // The line to log, if it is time for one.
  std::optional<std::string> add(IngestFault fault, std::uint64_t count, const std::string& why,
                                 std::int64_t host_utime_us) {
    const auto [logged, first] = logged_.try_emplace(fault);
    logged->second.since += count;
    if (!first && host_utime_us - logged->second.utime_us < period_us) return {};
    std::string line = fmt::format("{}: {} ({}{})", name_of(fault), why, logged->second.since,
                                   first ? " so far" : " since this was last logged");
    logged->second = {host_utime_us, 0};
    return line;
  }

 private:
  static constexpr std::int64_t period_us = 600'000'000;

  struct Logged {
    std::int64_t utime_us = 0;  // host's, when it was last logged
    std::uint64_t since = 0;    // further ones
  };
  std::map<IngestFault, Logged> logged_;
};

struct SessionSettings {
  energy::MeterSettings meter;
  telemetry::MissionLimits mission;
  bool implicit_missions = true;
  std::int64_t reorder_us = 500'000;  // how long samples wait for one that is missing before them
  std::int64_t sender_takeover_us =
      2'000'000;                          // silence of a robot's sender after which another one may speak
  std::int64_t max_ahead_us = INT64_MAX;  // of robots' clocks ahead of the host's; a log has none
  std::int64_t booked_margin_us = 60'000'000;  // see OpenMission::book
  double event_rate_hz = 5;                    // of mission events, in the long run
  std::size_t checkpoint_samples = 1024;       // a mission is checkpointed at this many samples at the latest
};

// The objects that a session acts on. `post` passes a command to the store's writer and may wait for it.
struct SessionOutputs {
  history::Store& store;
  std::function<void(history::Command)> post;
  FleetView& fleet;
  IngestCounters& counters;
  std::function<void(const std::string& robot_id, const std::string& text)> warn;
  // Called for each ended mission for training, with its legs and a function to post results; may be empty.
  using Post = std::function<void(history::Command)>;
  std::function<void(const Post& post, const std::shared_ptr<const ModelInForce>& model,
                     forecast::PastMission mission)>
      mission_ended = {};
  // The last change of a robot, which its refinement begins again from; may be empty.
  std::function<std::optional<drift::Mark>(const std::string& robot_id)> last_change = {};
  // Called with a model that may be better than the one in force; may be empty.
  std::function<void(history::Proposal)> suggest = {};
  // Reads what mission_ended needs, in the thread that reads the store, before the session; may be empty.
  std::function<Result<void>(const std::string& robot_id)> prepare = {};
};

// Everything between one robot's decoded messages and its history: plausibility, order, mission tracking,
// metering, trace, checkpoints, snapshot. A state machine without threads or clocks of its own:
// `host_utime_us` is the caller's clock, and the accounts depend on the robot's clock alone, so that a replay
// gives the same bits.
class RobotSession {
 public:
  RobotSession(const StoredRobot& stored, const SessionSettings& settings, SessionOutputs outputs);
  ~RobotSession();

  // Null: the robot has no model; samples are counted as faults until it has one. A declared mission keeps
  // the model that it began with, so that its accounts follow one model, and the change takes effect when it
  // ends. Otherwise, and in undeclared missions, which may last for days, it takes effect at the next sample.
  void set_model(std::shared_ptr<const ModelInForce> model);

  // Goes on with the mission that was open when the last daemon stopped, if any. The meter goes on from its
  // tail; without it, the time until the next sample is a gap.
  void resume(const StoredRobot& stored);

  // Continues from the state of the daemon that kept the robot before; `position`: of the last sample that
  // missions took in. Its samples, stored or not, are repeated between begin_repeats() and end_repeats().
  void take_over(const StoredRobot& stored, const std::optional<history::StreamPosition>& position);
  void begin_repeats() { repeats_ = true; }
  void end_repeats() { repeats_ = false; }

  // `one_of`: as in InboundMessage.
  void on_sample(const signals::Sample& sample, std::int64_t host_utime_us, std::int64_t one_of = 1);
  void on_event(const signals::MissionEvent& event, std::int64_t host_utime_us);
  // A scheduler's event, by the rules of the robot's own; it is no sign that the robot's telemetry lives.
  // Requests that were carried out before are ignored.
  void on_request(const MissionRequest& request);
  // Of a request with an effect that is stored.
  void recall(const MissionRequest& request);
  // Opens no mission and is no sign that the robot's telemetry lives.
  void on_covariates(const signals::CovariateMessage& message, std::int64_t host_utime_us);
  // `why` is a sentence on the last one, which is logged at most every ten minutes.
  void on_fault(IngestFault fault, std::uint64_t count = 1, std::string why = {});
  // The same for faults that the daemon's counters already include.
  void note_fault(IngestFault fault, std::uint64_t count, std::string why, std::int64_t host_utime_us);

  // The host's clock was set by `step_us`: earlier host times are converted to the new time.
  void on_host_clock_step(std::int64_t host_utime_us, std::int64_t step_us);
  // Call about once a second: ends missions that fell silent, checkpoints the open one, publishes changes.
  void on_tick(std::int64_t host_utime_us);
  // Checkpoints and publishes immediately; for an orderly stop, after which an open mission is resumed.
  void suspend();
  // The same for another daemon to take_over(), which goes on with the meter's last samples itself.
  void hand_over();

  // Publishes the snapshot if anything changed since the last one.
  void publish();

  const std::string& robot_id() const { return robot_id_; }

 private:
  struct Received {
    signals::Sample sample;    // as it came
    signals::Sample possible;  // without impossible readings
  };
  // A sample in the order of its sequence number, or that no order helps.
  void place(const signals::Sample& sample);
  void on_clock_step(const signals::Sample& sample, std::int64_t elapsed_us);
  // A sample of the open mission that is stamped before its start.
  void on_sample_before_start(const signals::Sample& sample);
  void doubt_clock(const char* id, double value, std::string says);
  // The next sample does not continue the last integration interval.
  void interrupt();
  void interrupt_meter();
  // True if the message must be dropped (and counted as a fault).
  bool is_too_fast(std::int64_t elapsed_us);
  bool is_too_far_ahead(std::int64_t utime_us, std::int64_t host_utime_us);
  bool may_send_event(std::int64_t host_utime_us);
  // What is wrong with an event of the robot, or of a scheduler, while the other has begun the open mission;
  // empty: it agrees. They may both name one mission.
  std::string contradiction_of(const signals::MissionEvent& event, bool requested) const;
  void take(const signals::MissionEvent& event, bool requested);
  // A sample in its place that is the robot's own, or that came while a charger fed it.
  void on_own_sample(const Received& received);
  void on_charger_sample(const signals::Sample& sample);
  void show(const signals::Sample& sample);
  void release_held();
  void leave_charger();
  void remember_charge();
  void judge_mission();
  void tell_contradictions(std::int64_t now);  // host's time
  // As it was when the open mission began.
  void restore_charge();
  // Whether the open mission, which ends with these contradictions, may be used for training.
  bool teaches(const std::vector<Contradiction>& found);
  void keep(const signals::Sample& sample);
  void carry_out(const telemetry::MissionActions& actions);
  void open(const telemetry::MissionAction& action);
  // Stores the open mission, which its first sample makes worth it.
  void begin_record();
  void close(const telemetry::MissionAction& action);
  void checkpoint();
  void on_point(const energy::MeterPoint& point);
  void meter_tail(std::span<const signals::Sample> tail);
  void meter(const signals::Sample& sample);
  // Meters the samples to which the step is decided; `ended`: all.
  void meter_waiting(bool ended);
  void meter_with(std::shared_ptr<const ModelInForce> model);
  // `ended`: with the samples that wait for a decision on the step to them.
  void flush_meter(bool ended = true);

  std::string robot_id_;
  SessionSettings settings_;
  SessionOutputs outputs_;
  std::shared_ptr<const ModelInForce> model_;  // the meter's
  std::shared_ptr<const ModelInForce>
      next_;  // in force, and the meter's when the open mission has ended; else null
  SampleOrder order_;
  std::int64_t one_of_ = 1;       // of the last sample
  std::int64_t implausible_ = 0;  // samples that no later sample has been found to miss
  std::int64_t counted_ = -1;     // the highest sequence number placed or refused as implausible
  telemetry::SequenceTracker sequence_;
  telemetry::MissionTracker missions_;
  std::unique_ptr<energy::Meter> meter_;
  signals::GapDetector gaps_;
  std::deque<signals::Sample> undecided_;  // in gaps_
  std::unique_ptr<ChargeWatch> charge_;
  std::unique_ptr<RefinementWatch> refinement_;
  std::string refinement_memory_;            // as stored by the last daemon
  std::string charge_memory_;                // as stored by the last daemon
  std::string charge_before_;                // of the sample that may open an implicit mission
  std::int64_t stored_charge_utime_us_ = 0;  // of the charge that the last daemon stored
  std::array<double, 2> stored_winding_temperature_c_{signals::unmeasured, signals::unmeasured};
  std::int64_t remembered_utime_us_ = 0;
  std::deque<Received> held_;  // until it is clear whether a charger feeds the robot
  bool at_charger_ = false;
  // Of all samples, and of those that are metered, which come later.
  std::optional<telemetry::ImpossibleReadings> impossible_;
  std::unique_ptr<ContradictionWatch> contradictions_;
  std::vector<Contradiction> stored_contradictions_;         // of the last mission of the last daemon
  std::map<std::string, std::int64_t> contradictions_told_;  // host's time when each was last reported
  CovariateWatch covariates_;
  TraceBuilder trace_;
  std::optional<forecast::LegTracker> legs_;
  std::unique_ptr<OpenMission> open_;
  RobotSnapshot snapshot_;
  std::int64_t last_sequence_ = 0;
  std::optional<history::StreamPosition> taken_in_;  // the last sample that a mission took in
  bool repeats_ = false;
  history::Mission requested_;           // the last one begun by request: its id and start
  std::int64_t requested_utime_us_ = 0;  // host clock at the last request since the robot was received
  EventAllowance event_allowance_;
  FaultLog fault_log_;
  bool changed_ = false;
};

}  // namespace joulecast::ingest
