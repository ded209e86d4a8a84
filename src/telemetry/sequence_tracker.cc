#include "telemetry/sequence_tracker.h"

#include <algorithm>

namespace joulecast::telemetry {
namespace {

// Numbers and clocks come from the wire: differences must not overflow.
std::int64_t difference(std::int64_t a, std::int64_t b) noexcept {
  std::int64_t result = 0;
  if (__builtin_sub_overflow(a, b, &result)) return a < b ? INT64_MIN : INT64_MAX;
  return result;
}

}  // namespace

SequenceTracker::Seen& SequenceTracker::slot(std::int64_t sequence) noexcept {
  return seen_[static_cast<std::uint64_t>(sequence) % memory];
}

Placement SequenceTracker::classify(std::int64_t sequence, std::int64_t utime_us) noexcept {
  Placement placement;
  if (!started_) return placement;

  const std::int64_t step = difference(sequence, newest_sequence_);
  placement.elapsed_us = difference(utime_us, newest_utime_us_);
  if (step > 0) {
    placement.arrival = step - 1 <= max_missing ? Arrival::fresh : Arrival::restart;
    if (placement.arrival == Arrival::fresh) placement.missing = step - 1;
    if (placement.elapsed_us <= 0) placement.clock = ClockStep::backward;
  } else {
    const Seen& seen = slot(sequence);
    const bool number_seen = seen.sequence == sequence;
    if (number_seen && seen.utime_us == utime_us) {
      placement.arrival = Arrival::duplicate;
      return placement;
    }
    if (placement.elapsed_us > 0) {
      placement.arrival = Arrival::restart;
    } else if (placement.elapsed_us < -backward_jump_us) {
      placement.arrival = Arrival::restart;
      placement.clock = ClockStep::backward;
    } else {
      placement.arrival = number_seen ? Arrival::duplicate : Arrival::late;
      return placement;
    }
  }
  if (!paused_ && placement.elapsed_us > forward_jump_us && placement.arrival == Arrival::fresh)
    placement.clock = ClockStep::forward;
  return placement;
}

Placement SequenceTracker::place(std::int64_t sequence, std::int64_t utime_us) noexcept {
  if (sequence > fallen_from_) {
    --counters_.restarts;
    newest_sequence_ = std::min(fallen_from_ + 1, sequence - 1);
  }
  const Placement placement = classify(sequence, utime_us);
  ++counters_.received;
  switch (placement.arrival) {
    case Arrival::first:
    case Arrival::fresh:
      ++counters_.fresh;
      break;
    case Arrival::restart:
      ++counters_.fresh;
      ++counters_.restarts;
      break;
    case Arrival::duplicate:
      ++counters_.duplicate;
      return placement;
    case Arrival::late:
      ++counters_.late;
      // A number so old that a newer one holds its slot is not remembered: repeated it counts as late.
      if (slot(sequence).sequence < sequence) slot(sequence) = {sequence, utime_us};
      return placement;
  }
  counters_.missing += static_cast<std::uint64_t>(placement.missing);
  counters_.clock_backward += placement.clock == ClockStep::backward ? 1 : 0;
  counters_.clock_forward += placement.clock == ClockStep::forward ? 1 : 0;

  const bool restart = placement.arrival == Arrival::restart;
  if (restart) seen_.fill({});
  const bool fell = restart && sequence < newest_sequence_ && placement.clock == ClockStep::none;
  fallen_from_ = fell ? newest_sequence_ : INT64_MAX;
  started_ = true;
  paused_ = false;
  newest_sequence_ = sequence;
  newest_utime_us_ = utime_us;
  slot(sequence) = {sequence, utime_us};
  return placement;
}

}  // namespace joulecast::telemetry
