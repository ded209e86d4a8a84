#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

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

// A motion along one coordinate in closed form: up to five pieces, each of constant acceleration or an
// extremal (4-9).
class LineMotion {
 public:
  LineMotion(const dynamics::QuadraticPower& power) : power_(power) {}

  void append_free(const LineTask& task, double distance, double start_speed, double end_speed,
                   double duration_s);
  void append_free(const LineProfile& profile);
  void append_ramp(double start_speed, double acceleration, double duration_s);

  double duration_s() const { return duration_; }
  double distance() const { return distance_; }
  double energy_j() const { return energy_; }
  LineState state(double time_s) const;
  double speed(double time_s) const { return state(time_s).speed; }
  double acceleration(double time_s) const { return state(time_s).acceleration; }
  double position(double time_s) const { return state(time_s).position; }
  double peak_speed() const { return peak_speed_; }
  double peak_acceleration() const { return peak_acceleration_; }
  double lowest_speed() const { return lowest_speed_; }
  // Times from 0 to the duration, the joints of the pieces among them; each cell of an extremal takes about
  // 1/`cells` of the duration or of the changes of speed, whichever is shorter; pieces of constant
  // acceleration, which their end rows determine, are divided four times as coarsely or not at all.
  std::vector<double> times(std::size_t cells) const;
  bool holds_acceleration() const { return holds_acceleration_; }  // somewhere at a constant one but 0
  bool holds_speed() const { return holds_speed_; }                // somewhere at a constant one

  // Departure from the conditions of optimality [W]: along every extremal piece the Hamiltonian must vanish,
  // (4-13), and the multiplier of the distance be the same for all pieces, times the peak speed.
  double residual_w() const { return residual_w_; }

 private:
  struct Piece {
    double start_s = 0, start = 0, duration_s = 0;
    double speed = 0, acceleration = 0;
    std::optional<LineProfile> free;
  };
  const Piece& at(double& time_s) const;
  Piece& append(double duration_s, double distance, double energy_j);

  dynamics::QuadraticPower power_;
  std::array<Piece, 5> pieces_{};
  std::size_t count_ = 0;
  double duration_ = 0, distance_ = 0, energy_ = 0;
  double peak_speed_ = 0, lowest_speed_ = 1e300, peak_acceleration_ = 0, residual_w_ = 0;
  std::optional<double> multiplier_;
  bool holds_acceleration_ = false, holds_speed_ = false;
};

// Minimum of energy + value of time * duration where |acceleration| and speed are bounded: full acceleration,
// the extremal, the speed limit, and back. Free end time makes the Hamiltonian zero all along, also on the
// bounds; with it, a piece at speed v_p (the limit, or the peak where acceleration is zero) fixes the
// multiplier of the distance, hence the whole profile:
//   a^2 = (v_p - v)(price/(c1 v_p) - k^2 v),  k^2 = c2/c1,
// with elementary integrals. Empty where the optimum is not of this shape: end speeds so high for the
// distance that the profile falls between them, or rises monotonically.
std::optional<LineMotion> line_within(const LineTask& task, double speed_limit, double acceleration_limit);

// Of all motions from rest to rest in free time, the one with the peak speed `peak`; `peak` is below
// best_speed_of(), at which the speed's extremal is constant.
LineMotion line_to_peak(const LineTask& task, double peak, double acceleration_limit);
// The speed of least cost a metre; infinite without viscosity.
double best_speed_of(const LineTask& task);

// The least time within the bounds; infinite where none suffices.
double shortest_time_within(const LineTask& task, double speed_limit, double acceleration_limit);

}  // namespace joulecast::planning
