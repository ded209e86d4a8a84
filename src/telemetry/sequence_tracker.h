#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace joulecast::telemetry {

// A longer jump is the robot's clock being set, not time passing.
inline constexpr std::int64_t forward_jump_us = 3'600'000'000;
// A sample that is older by more than this is not merely late.
inline constexpr std::int64_t backward_jump_us = 5'000'000;
// A larger leap of the sequence is a restart, not a loss.
inline constexpr std::int64_t max_missing = 1'000'000;

enum class Arrival {
  first,      // the first sample of this robot's stream
  fresh,      // newer than all before it
  duplicate,  // seen already
  late,       // older than one already taken and not seen yet: out of order
  restart     // the robot's counter restarted: it booted
};

enum class ClockStep { none, backward, forward };

// The place of one sample in its robot's stream.
struct Placement {
  Arrival arrival = Arrival::first;
  ClockStep clock = ClockStep::none;
  std::int64_t missing = 0;  // sequence numbers skipped just before this sample
  std::int64_t elapsed_us =
      0;  // robot's clock since the newest sample before it; meaningless at a clock step

  // The sample advances the stream; duplicates and late ones do not.
  [[nodiscard]] bool advances() const noexcept {
    return arrival != Arrival::duplicate && arrival != Arrival::late;
  }
  // The time since the sample before it is available and positive, so that power may be integrated over it.
  [[nodiscard]] bool continues() const noexcept {
    return (arrival == Arrival::fresh || arrival == Arrival::restart) && clock == ClockStep::none;
  }
};

struct SequenceCounters {
  std::uint64_t received = 0;
  std::uint64_t fresh = 0;  // first, fresh and restart
  std::uint64_t duplicate = 0;
  std::uint64_t late = 0;
  std::uint64_t missing =
      0;  // numbers skipped; those that came late are in `late` too, so missing - late were lost
  std::uint64_t restarts = 0;
  std::uint64_t clock_backward = 0;
  std::uint64_t clock_forward = 0;
};

// Orders one robot's stream by its own sequence numbers and clock; depends on nothing else, so that a replay
// gives the same counts as the live run. A number that goes back while the clock goes on is a restart; one
// that goes back with the clock is late, or a duplicate when that number and instant were seen among the last
// `memory` samples; one that goes back with a clock further back than backward_jump_us is a restart with a
// clock step. A clock that does not advance while the sequence does is a backward step; one that leaps while
// the robot stayed up is a forward step, but before a restart it is the time the robot was off. Where the
// number after a restart goes on above those before it, the restart was one corrupt number and is not
// counted.
class SequenceTracker {
 public:
  static constexpr std::size_t memory = 64;

  Placement place(std::int64_t sequence, std::int64_t utime_us) noexcept;
  // A mission begins: the time before its first sample is a pause, however long, and no forward step.
  void pause() noexcept { paused_ = true; }

  [[nodiscard]] const SequenceCounters& counters() const noexcept { return counters_; }

 private:
  struct Seen {
    std::int64_t sequence = INT64_MIN;  // none: numbers are not negative
    std::int64_t utime_us = 0;
  };

  [[nodiscard]] Seen& slot(std::int64_t sequence) noexcept;
  [[nodiscard]] Placement classify(std::int64_t sequence, std::int64_t utime_us) noexcept;

  SequenceCounters counters_;
  std::array<Seen, memory> seen_{};
  bool started_ = false, paused_ = false;
  std::int64_t newest_sequence_ = 0;
  std::int64_t fallen_from_ = INT64_MAX;  // the number before the newest one, where that one restarted below
  std::int64_t newest_utime_us_ = 0;
};

}  // namespace joulecast::telemetry
