#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamics/motion.h"

// The climb: the angle of the floor along a robot's heading [rad], nose up positive. It is the measured
// pitch; without one it follows from the height over the distance driven.
//
// Heights are held and rounded readings: a height with a resolution of a metre may change by a metre between
// two samples. The height is therefore taken as a broken line over the distance driven that passes half way
// between two readings half way between their places. The climb is the slope of its best straight line over a
// window: half a metre, or the way of one second, or so far to each side (online: behind the robot) that one
// usual change of the reading makes 1 % of slope, whichever is longest. Changes of the height at standstill,
// and jumps, are attributed to the sensor.
namespace joulecast::dynamics {

struct ClimbReading {
  std::int64_t utime_us = 0;
  double speed_m_s = 0;        // of the axle's middle, forward positive
  double pitch_rad = unknown;  // nose up positive
  double height_m = unknown;   // above any fixed datum, the last one read
  bool bridged = true;         // the step to it is no gap (signals/gaps.h); of no account for the first
};

// The angle with the sine rise over way, both along the heading; unknown above 45 degrees: the height jumped.
double climb_over(double rise_m, double way_m);

// The height over the way of one run, in which the robot neither turns back nor is lost sight of.
class HeightProfile {
 public:
  // `grain_m` of the heights decides how finely they are kept.
  void add(double way_m, bool standing, double height_m, double grain_m);
  void clear();

  double begin_m() const { return knots_.empty() ? 0 : knots_.front().way_m; }
  // The slope of the straight line that fits the profile best over [from, to]; from < to, both within it.
  double slope(double from_m, double to_m) const;
  // Removes the profile before `way_m`; of more than a thousand heights at least the older half.
  void forget_before(double way_m);

 private:
  struct Knot {
    double way_m = 0, height_m = 0;
    double count = 1;  // readings that it is the mean of
  };

  std::vector<Knot> knots_;  // by way
  double last_way_m_ = 0, last_height_m_ = 0;
  double drift_m_ = 0;  // of the readings while the robot stood, and their jumps
};

// The climb online, from the way behind the robot. Its result is unknown until half a window is driven; at
// standstill, and until half a window is driven again, it stays unchanged.
class ClimbTracker {
 public:
  // Readings in order of time; a gap restarts the window.
  double add(const ClimbReading& reading);

 private:
  void learn(double step_m);

  static constexpr std::size_t remembered_steps = 63;
  HeightProfile profile_;
  std::array<double, remembered_steps> steps_m_{};
  std::size_t steps_ = 0;
  double grain_m_ = 0;
  std::int64_t last_utime_us_ = INT64_MAX;
  double last_speed_m_s_ = 0, last_height_m_ = unknown;
  double way_m_ = 0;
  int direction_ = 0;  // of the run: 1 forward, -1 backward, 0 not begun
  double climb_rad_ = unknown;
};

// The climb at each reading of a recording, in order of time: the window extends to both sides, one-sided at
// the ends of a run. Unknown before the first place with a climb.
std::vector<double> climb_along(std::span<const ClimbReading> readings);

}  // namespace joulecast::dynamics
