#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "planning/line.h"

namespace joulecast::planning {

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
