#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>

#include "signals/sample.h"
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
          sample.utime_us > newest_us || sample.utime_us < newest_utime_us_ - backward_jump_us;
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
  static constexpr std::int64_t backward_jump_us = telemetry::SequenceLimits{}.backward_jump_us;
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

}  // namespace joulecast::ingest
