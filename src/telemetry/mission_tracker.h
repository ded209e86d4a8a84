#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "signals/sample.h"

namespace joulecast::telemetry {

struct MissionLimits {
  std::int64_t implicit_idle_us = 60'000'000;    // silence that ends an implicit mission
  std::int64_t implicit_max_us = 3'600'000'000;  // an implicit mission is cut into pieces no longer than this
  std::int64_t explicit_silence_us = 600'000'000;  // silence after which a mission counts as never finished
  std::int64_t explicit_max_us = 24 * 3'600'000'000LL;  // a mission longer than this counts as never finished
  // Events older by more than this show a clock set back; nearer starts of one name are one.
  std::int64_t reorder_us = 5'000'000;
  std::int64_t after_end_us = 500'000;  // samples this soon after a mission's end start no other
};

enum class MissionEnd {
  finished,    // reported by the robot
  aborted,     // reported by the robot
  superseded,  // another mission was STARTED while this one was open
  unfinished,  // an explicit mission that fell silent or outlived its longest duration
  idle,        // an implicit mission that fell silent
  expired      // an implicit mission that reached its longest duration
};

struct OpenMission {
  std::string mission_id;
  std::int64_t start_utime_us = 0;
  std::int64_t last_utime_us = 0;  // of the newest sample or event that belongs to it
  double payload_kg = signals::unmeasured;
  bool implicit = false;

  friend bool operator==(const OpenMission&, const OpenMission&) = default;
};

struct MissionAction {
  enum class Kind { open, close };
  Kind kind = Kind::open;
  std::string mission_id;
  std::int64_t utime_us = 0;  // robot's clock: where the mission begins or ends
  bool implicit = false;
  double payload_kg = signals::unmeasured;  // open: as declared
  MissionEnd end = MissionEnd::finished;    // close only
  std::string note;                         // the event's note, if an event caused this
};

using MissionActions = std::vector<MissionAction>;

struct SampleStep {
  MissionActions actions;
  bool belongs = false;  // to the mission open after the actions
};

struct MissionCounters {
  std::uint64_t duplicate_events = 0;     // received already, or a late end of an ended mission
  std::uint64_t out_of_order_events = 0;  // older than the mission they would change
  std::uint64_t unknown_missions = 0;     // an end of a mission without a received start
  std::uint64_t samples_outside = 0;      // belong to no mission: before its start, or just after an end
};

// From the samples and events of ONE robot, in the order they arrived, to the boundaries of its missions. A
// pure state machine: no clock, no store; the caller carries the returned actions out in order. All times are
// the robot's.
//
// Telemetry without a mission opens an implicit one, `implicit-<utime>`. A STARTED closes the open mission.
// The end of an unknown mission ends an open implicit mission (it was that mission, received from its middle)
// and is otherwise only counted.
//
// A mission is its id AND its start. A robot that restarts its count of missions after a boot reuses ids: a
// STARTED of a stored id within reorder_us of that mission's start is the same start again and changes
// nothing, any other begins another mission of that id.
class MissionTracker {
 public:
  static constexpr std::size_t memory = 64;

  explicit MissionTracker(MissionLimits limits = {}) : limits_(limits) {}

  // Call before integrating a sample that advances the stream: carry the actions out, then count the sample
  // to current() if it belongs.
  SampleStep on_sample(std::int64_t utime_us, double payload_kg);
  MissionActions on_event(const signals::MissionEvent& event);
  // Nothing was received from the robot for so long by the HOST's clock.
  MissionActions on_silence(std::int64_t silent_us);
  // The robot's clock was set (ClockStep of the sequence tracker): the open mission goes on in the new time;
  // one that began after the step is left as it is. Implicit missions of the past were in the old time;
  // announced ones still refuse their repeated samples.
  void on_clock_step(std::int64_t utime_us);
  // Before that, where the clock starts again and no event announced the open mission: ends it.
  MissionActions on_restart();
  // Continue a mission that a restarted service finds open in its store.
  void resume(OpenMission mission);
  // Before that: missions of the past, oldest first, so that repeated events and samples of them are
  // recognised. `was_said`: the robot reported its end.
  void recall(OpenMission mission, bool was_said);

  [[nodiscard]] const std::optional<OpenMission>& current() const noexcept { return current_; }
  [[nodiscard]] const MissionCounters& counters() const noexcept { return counters_; }

 private:
  // A mission of the past, or one of which the end came without a start.
  struct Past {
    std::string mission_id;
    std::optional<std::int64_t> start_us;     // according to its STARTED; absent: no start was received
    std::optional<std::int64_t> said_end_us;  // according to FINISHED or ABORTED
    std::int64_t from_us = 0;                 // its span in the clock at its end
    std::int64_t to_us = -1;
    bool implicit = false;
  };

  void open(MissionActions& actions, std::string id, std::int64_t utime_us, double payload_kg,
            std::string note, bool implicit);
  void open_implicit(MissionActions& actions, std::int64_t utime_us, double payload_kg);
  // `said_us`: the time of the end according to the robot.
  void close(MissionActions& actions, std::int64_t utime_us, MissionEnd end, std::string note = {},
             std::optional<std::int64_t> said_us = {});
  // `silent_us` since its newest sample or event, `lasted_us` since its start.
  void close_if_over(MissionActions& actions, std::int64_t silent_us, std::int64_t lasted_us);
  void on_start(MissionActions& actions, const signals::MissionEvent& event);
  void on_end(MissionActions& actions, const signals::MissionEvent& event);
  void remember(Past past);
  [[nodiscard]] bool is_same_instant(std::int64_t said_us, std::int64_t other_us) const noexcept;
  // A mission of the past that satisfies `is_it` and is called so.
  [[nodiscard]] bool any_past(std::string_view mission_id, auto is_it) const;
  [[nodiscard]] bool lies_in_past(std::int64_t utime_us) const noexcept;

  MissionLimits limits_;
  MissionCounters counters_;
  std::optional<OpenMission> current_;
  std::int64_t begin_us_ = 0;  // start of the current mission in the robot's present clock
  std::optional<std::int64_t> explicit_end_us_;
  std::deque<Past> past_;
};

}  // namespace joulecast::telemetry
