#pragma once

#include "base/error.h"
#include "dynamics/straight.h"

namespace joulecast::planning {

// A motion along one coordinate with quadratic power: a straight line [m], a turn in place [rad], an arc at
// constant curvature, or a wheel's angle. `power` is everything that the battery pays, idle power in c0.
struct LineTask {
  dynamics::QuadraticPower power;
  double distance = 0;         // > 0, in the coordinate's unit
  double start_speed = 0;      // >= 0
  double end_speed = 0;        // >= 0
  double value_of_time_w = 0;  // value of a second in addition to its energy; affects only the end time
};

struct LineState {
  double position = 0;
  double speed = 0;
  double acceleration = 0;
};

// Thesis (4-9): the extremal v'' = k^2 v - B of minimum energy, with k^2 = c2/c1 and B = -(c3 + lambda1)/(2
// c1). Written with decaying exponentials only, so that neither long times (k t large) nor vanishing
// viscosity (k -> 0, where the profile is a parabola) lose digits.
class LineProfile {
 public:
  // The one extremal that covers the task's distance between its end speeds in `duration_s` > 0.
  LineProfile(const LineTask& task, double duration_s);

  double duration_s() const { return duration_; }
  double distance() const { return distance_; }
  double energy_j() const;
  LineState state(double time_s) const;
  double speed(double time_s) const { return state(time_s).speed; }
  double acceleration(double time_s) const { return state(time_s).acceleration; }
  double position(double time_s) const { return state(time_s).position; }
  double peak_speed() const;
  double lowest_speed() const;       // negative when the profile runs backwards
  double peak_acceleration() const;  // largest absolute value; at an end, since |a| is convex
  double start_acceleration() const { return start_acceleration_; }
  double end_acceleration() const { return end_acceleration_; }

  // H(t_f) + value of time, thesis (4-13) [W]: how fast the cost grows with the end time. Zero at the free
  // one.
  double transversality_w() const { return power_.c0 + value_of_time_ + power_.c1 * invariant(); }

  // The multiplier lambda_1 of the distance, thesis (4-9) [W s/x].
  double distance_multiplier() const { return -power_.c3 - 2 * power_.c1 * thrust_; }

 private:
  double invariant() const;  // k^2 v^2 - a^2 - 2 B v, constant along the profile

  dynamics::QuadraticPower power_;
  double value_of_time_, distance_, start_, end_, duration_;
  double rate_;        // k
  double left_;        // exp(-k T)
  double less_twice_;  // exp(-2 k T) - 1
  double thrust_;      // B
  double start_acceleration_, end_acceleration_;
};

// Minimum of energy + value of time * duration over profile and duration, by transversality (4-13).
// Needs c0 + value of time > 0: with time for free, no finite end time is best.
Result<LineProfile> line_in_free_time(const LineTask& task);

}  // namespace joulecast::planning
