#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "signals/sample.h"

// Gaps in a robot's telemetry: one rule for metering, climb, checks and diagnosis, online and offline.
//
// The step from one sample to the next is bridged, i.e. readings are interpolated over it, where
//   step <= min(bound, max(1 s, 10 max(P_before, P_after)))
// and is a gap otherwise. P_before is the sample period of the 32 steps before it, P_after that of the 3
// steps after it, or of as many as there are. A period is the mean of those steps that miss no sequence
// number, where they are at least half (losses do not lengthen it); else the mean of all (a log of every
// tenth message). A step without neighbours is compared with the bound alone.
namespace joulecast::signals {

// Offline metering bridged as much in streams of every rate before the rule depended on the period.
inline constexpr double always_bridged_s = 1;
// Longer are 0.3^9 of the steps where samples are lost with probability 0.3, i.e. 2 in 100,000, and 7 in
// 100,000 where their instants are random (Poisson; simulated).
inline constexpr double bridged_periods = 10;
// Three times bridged_periods: three pauses among these steps do not make a fourth of their length usual.
inline constexpr std::size_t steps_before = 32;
// For which an online decision may wait.
inline constexpr std::size_t steps_after = 3;
// The usual bound: two samples in a row may be lost at 0.1 Hz, the slowest rate of robot_telemetry_t.
inline constexpr double usual_bound_s = 30;

// The longest step that is bridged in a stream of this sample period [s].
double longest_bridged_s(double period_s, double bound_s = usual_bound_s);

// A quantity that is read less often than samples come: its last reading, as long as its period is bridged.
class HeldReading {
 public:
  // The value at that time, of which NaN is no reading.
  double take(std::int64_t utime_us, double value);

 private:
  double last_ = unmeasured, period_s_ = 0;
  std::int64_t last_utime_us_ = 0;
};

enum class Step {
  first,  // of a stream: there is no sample before
  bridged,
  gap
};

// The step to each sample; samples are in order of time.
std::vector<Step> steps_of(std::span<const Sample> samples, double bound_s = usual_bound_s);

// The same, sample by sample: the step to a sample is decided immediately, or after up to steps_after more
// samples where it exceeds the bound by P_before. The decisions depend on the last steps_before + 1 samples
// before the undecided ones, and on no others.
class GapDetector {
 public:
  struct Decision {
    Step step = Step::first;
    double step_s = 0;
  };

  explicit GapDetector(double bound_s = usual_bound_s) : bound_s_(bound_s) {}

  // Takes the next sample.
  void add(std::int64_t utime_us, std::int64_t sequence);
  // The decision on the next sample in order; none: it depends on samples to come. `ended`: none come.
  std::optional<Decision> next(bool ended = false);
  // The next sample is the first of a stream.
  void reset();

 private:
  struct Mark {
    std::int64_t utime_us = 0, sequence = 0;
  };
  static double period_s(std::span<const Mark> marks);
  std::optional<Decision> decide(bool ended) const;

  double bound_s_;
  std::vector<Mark> marks_;
  std::size_t next_ = 0;  // first undecided
};

}  // namespace joulecast::signals
