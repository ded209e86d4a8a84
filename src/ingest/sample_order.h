#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>

#include "signals/sample.h"

namespace joulecast::ingest {

// Puts one robot's samples back into the order of their sequence numbers: behind a hole samples wait for
// those that are missing, for `window_us` of the host's clock at most. In a stream without holes nothing
// waits. Samples older than the last one that was passed on, and restarts of the sequence, pass immediately;
// SequenceTracker classifies them.
class SampleOrder {
 public:
  using Sink = std::function<void(const signals::Sample&)>;

  SampleOrder(std::int64_t window_us, std::int64_t backward_jump_us, Sink sink)
      : window_us_(window_us), backward_jump_us_(backward_jump_us), sink_(std::move(sink)) {}

  // Goes on after a sample that was passed on elsewhere; before the first.
  void start_after(std::int64_t sequence, std::int64_t utime_us) {
    next_ = sequence + 1;
    newest_utime_us_ = utime_us;
  }
  // False: a duplicate of one that waits.
  bool take(const signals::Sample& sample, std::int64_t host_utime_us);
  // Passes on the samples that have waited long enough.
  void release(std::int64_t host_utime_us);
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

  void pass(const signals::Sample& sample);
  // Passes on the first that waits and all that follow it without a hole.
  void pass_run();

  std::int64_t window_us_, backward_jump_us_;
  Sink sink_;
  std::map<std::int64_t, Waiting> waiting_;  // by sequence number
  std::int64_t since_us_ = 0;                // when the first of those that wait came
  std::int64_t next_ = -1;                   // the number expected; -1: none yet
  std::int64_t newest_utime_us_ = 0;         // of those passed on
};

}  // namespace joulecast::ingest
