#pragma once

#include <array>
#include <vector>

#include "planning/line.h"

namespace joulecast::planning {

struct LineSample {
  double time_s = 0;
  double distance = 0;
  double speed = 0;
  double acceleration = 0;
  double power_w = 0;
  double energy_j = 0;  // since the start
};

// A speed profile of up to three spans of constant acceleration: the trapezoids and triangles that robots
// drive without a planner, the baselines of thesis tables 4-1 to 4-4.
class RampProfile {
 public:
  struct Span {
    double duration_s = 0;
    double start_speed = 0;
    double acceleration = 0;
  };

  RampProfile(const dynamics::QuadraticPower& power, const std::array<Span, 3>& spans);

  double duration_s() const;
  double distance() const;
  double peak_speed() const;
  double energy_j() const;  // exact: the power is quadratic in time within a span
  LineSample at(double time_s) const;
  std::vector<LineSample> sample(std::size_t count) const;
  const std::array<Span, 3>& spans() const { return spans_; }

 private:
  dynamics::QuadraticPower power_;
  std::array<Span, 3> spans_;
};

// Accelerating for `ramp_fraction` of the duration and braking for as long: 1/3 is the trapezoid of the
// thesis (4.3.1), 1/2 the triangle. Infeasible when the distance is too short for the end speeds in that
// time.
Result<RampProfile> ramp_in_time(const LineTask& task, double duration_s, double ramp_fraction);

// The same shape at its own best duration: minimum of energy + value of time * duration.
Result<RampProfile> ramp_in_free_time(const LineTask& task, double ramp_fraction);

// As fast as the limits allow: full acceleration to the speed limit, or to where braking must begin.
Result<RampProfile> ramp_by_limits(const LineTask& task, double speed_limit, double acceleration_limit);

}  // namespace joulecast::planning
