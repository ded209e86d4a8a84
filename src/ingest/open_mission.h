#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "energy/meter.h"
#include "history/records.h"
#include "history/trace_merge.h"
#include "ingest/counters.h"
#include "signals/sample.h"
#include "telemetry/mission_tracker.h"
#include "telemetry/recording.h"

namespace joulecast::ingest {

// The open mission as stored, and its data since the last checkpoint.
struct OpenMission {
  // Begun by its robot, with the memory of the charge watch at that time.
  OpenMission(const std::string& robot_id, const telemetry::MissionAction& action, std::int64_t model_version,
              std::string charge_memory);
  // Left open by the last daemon.
  explicit OpenMission(const history::Mission& stored);

  void end_at(std::int64_t utime_us);  // a clock that is set back would end it before its start
  void keep(const signals::Sample& sample);
  void mark_incomplete(const char* reason);
  // The meter was replaced: its gaps are counted from zero again.
  void use_another_meter(std::int64_t model_version);
  // The first sample if the meter has not received the samples before it.
  void go_on_after_silence(std::int64_t utime_us);
  void refresh(const energy::Meter& meter);
  void finish(const telemetry::MissionAction& action);

  // Once its robot's clock was set within a mission, the robot's time may pass no faster than the host's, but
  // for a margin: else a clock that is set again and again would book more energy than there was time for.
  void on_clock_step(std::int64_t host_utime_us);
  // How long its samples have lasted since the clock was set, with this one, and the host's time since then,
  // where that is too fast; else the sample's time is booked.
  struct TooFast {
    std::int64_t booked_us, passed_us;
  };
  std::optional<TooFast> book(std::int64_t elapsed_us, std::int64_t host_utime_us, std::int64_t margin_us);

  history::Mission record;
  bool stored = false;
  std::vector<signals::Sample> samples;
  std::uint64_t unsaved = 0;
  telemetry::MissionPayload payload;
  bool was_down = false;        // resumed after a restart
  bool resumed_silent = false;  // resumed, and nothing came since
  bool unmetered = false;       // resumed, and the meter has not received the samples before
  std::string charge_memory;    // of its begin

 private:
  // Gaps that earlier meters counted.
  std::int64_t earlier_gaps_ = 0;
  double earlier_gap_s_ = 0;
  std::optional<std::int64_t> stepped_utime_us_;  // host's, when the robot's clock was first set
  std::int64_t booked_us_ = 0;                    // since then
};

// Folds the meter's points into the store's one-second trace buckets.
class TraceBuilder {
 public:
  void begin();
  // `accounts` and `state_of_charge` (0 to 1; NaN: unknown, the latest known one stays) as of the point.
  void add(const energy::MeterPoint& point, const signals::Accounts& accounts, double state_of_charge);
  // The buckets that changed since the last call; the newest one may come again, fuller.
  std::vector<history::TraceBucket> take();

 private:
  std::vector<history::TraceBucket> finished_;
  std::optional<history::BucketSum> open_;
  bool touched_ = false;  // since the last take()
};

}  // namespace joulecast::ingest
