#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "base/error.h"
#include "planning/load.h"
#include "planning/problem.h"

namespace joulecast::planning {

// A run along which loads and limits stay the same: a straight line, an arc, a turn in place. Speeds are of
// the run's coordinate [m/s or rad/s], limits may be infinite.
struct UniformTask {
  WheelLoads loads;
  Electric electric;
  double distance = 0;
  double start_speed = 0, end_speed = 0;
  double speed_limit = 0;  // finite
  double acceleration_limit = 0;
  double torque_limit_nm = 0, voltage_limit_v = 0;
  std::size_t cells = 64;  // of the speed range on either side of the cruise
  // Share of a cell's acceleration that may be left unused for motors' limits to be kept at its ends.
  double motor_tolerance = 3e-4;
};

// Speeds at places along the way, the acceleration being constant in between.
struct SteppedMotion {
  std::vector<double> way, speed;
  double duration_s = 0;
  double energy_j = 0;          // idle power included
  double discretisation_j = 0;  // the cost of constant acceleration between the nodes
  std::array<bool, bound_count> binding{};
};

// A motion from rest to rest in free time.
struct RestMotion {
  double distance = 0;
  double duration_s = 0;
  double energy_j = 0;  // idle power included
};

// Why no best end time exists: power at standstill and price of time, together `standing_w`, are not
// positive.
tl::unexpected<Error> endless(double standing_w);

// Minimum of energy + price * duration where power depends on speed and acceleration alone. With lambda, the
// multiplier of the distance, the problem is to minimise the integral of
//   L(v, a) = P(v, a) + idle + price - lambda v
// over time. L does not depend on time, so the Hamiltonian is constant, and zero in free time (Bryson & Ho,
// Applied Optimal Control, sec. 2.7). Where the speed rises or falls, dt = dv/|a| makes the integral one over
// the speed,
//   integral of L(v, a)/|a| dv,
// in which each speed has its own acceleration: that of least L/|a| within the limits of acceleration,
// current and voltage there: where a dL/da = L, or at the limit, as L is convex in a as long as braking costs
// nothing. The speed
// turns where L(v, 0) = 0: lambda = f(v_turn) with f(v) = (P(v, 0) + idle + price)/v. f falls from infinity
// to its least value at the speed of least cost a metre, or to the speed limit, and a motion from rest has
// its peak at the speed below that at which the distance comes out; long ways cruise there. End speeds above
// it are left likewise.
//
// Between nodes of the speed the acceleration is constant, so the answer can be driven exactly as returned:
// current and voltage limits are respected throughout a cell, to 2e-5. motor_tolerance determines the size of
// cells.
class UniformMotion {
 public:
  // motor_tolerance of the fastest motion, to be used where time is short.
  static constexpr double hurried_tolerance = 1e-4;

  // Empty when f has several minima within the speed limit (friction that falls steeply with the speed), the
  // motors cannot hold a steady speed from rest to the end speeds, nothing bounds braking that neither costs
  // nor returns anything (it is a jump), or losses of a gear turn with the sign of the torque.
  static std::optional<UniformMotion> make(const UniformTask& task);

  // Fault::infeasible when the way is too short for the end speeds, or when no finite time is best.
  Result<SteppedMotion> solve(double price_w) const;
  // As fast as the limits allow; its price of time is infinite. Empty where the way is too short for the end
  // speeds, or no limit bounds the acceleration.
  std::optional<SteppedMotion> fastest() const;
  // Time of that motion; distance over speed limit when the acceleration is unbounded, infinite when the way
  // is too short.
  double shortest_s() const;

  // Of all free-time motions from rest to rest, that which turns at `peak`: the integrals of 1/|a|, v/|a| and
  // P/|a| over the speed, by Gauss's rule between the speeds at which limits or the flow of power change.
  RestMotion to_peak(double peak, double price_w) const;
  // The speed at which long ways are driven.
  double cruise_speed(double price_w) const { return cheapest_speed(task_.electric.idle_w + price_w); }

 private:
  // The motors' torques at a speed, acceleration left out.
  struct Local {
    double v = 0;
    std::array<double, 2> torque{};  // [N m]
  };
  struct Power {
    double w = 0, slope = 0, bend = 0;  // of the motors at the battery, by acceleration
  };
  struct Most {
    double acceleration = 0;  // negative: even a steady speed is beyond the limits
    Bound bound = Bound::acceleration;
    bool bounded = true;
  };
  // The trade between time and distance. Fastest: the greatest accelerations at any cost.
  struct Price {
    double fixed_w = 0;  // idle power and price of time
    double lambda = 0;   // W s/x
    bool fastest = false;
    bool rough = false;  // motors' limits at the middle of cells only
  };
  struct End {
    double v = 0;
    Most wanted;           // acceleration there
    Most allowed, beyond;  // by the limits, and with a motor's overuse
  };
  struct Piece {
    double from = 0, to = 0, acceleration = 0;  // > 0
    Bound bound = Bound::acceleration;
    bool bounded = false;

    double duration_s() const { return std::fabs(to - from) / acceleration; }
    double distance() const { return 0.5 * (from + to) * duration_s(); }
  };
  // From the start speed to the end speed by way of a third; the rest of the way is driven at that one.
  struct Shape {
    Price price;
    double middle = 0;
    bool cruises = true;
    std::vector<Piece> driven;  // as distance() found it
  };

  explicit UniformMotion(const UniformTask& task);

  Local local(double v) const;
  Power motors(const Local& l, double acceleration) const;
  Most most(const Local& l, double direction, double tolerance) const;
  double best(const Local& l, double direction, double rate_w, double most) const;
  double level(const Local& l, double direction, double rate_w, double most) const;
  double steady_cost(double v, double fixed_w) const { return (motors(local(v), 0).w + fixed_w) / v; }
  double cheapest_speed(double fixed_w) const;
  double stretch(double pivot, double end, const Price& price) const;
  bool has_motor_limits() const;
  Most wanted(const Local& l, Most within, double direction, const Price& price) const;
  Most wanted(double v, double direction, const Price& price) const;
  End end_at(double v, double direction, const Price& price) const;
  template <class Visit>
  void piece(const End& from, const End& to, double change, const Price& price, int halvings,
             Visit&& visit) const;
  template <class Visit>
  void leg(double from, double to, bool pivot_at_end, const Price& price, Visit&& visit) const;
  template <class Visit>
  void pieces(const Shape& shape, Visit&& visit) const;
  double distance(Shape& shape) const;
  std::optional<Shape> shape_at(double fixed_w) const;
  Shape turning(Shape shape, double nearest, double farthest) const;
  std::optional<Shape> monotone(Shape shape, double highest_lambda) const;
  std::optional<Shape> fastest_shape() const;
  SteppedMotion written(const Shape& shape) const;
  struct Least {
    double integral_j = 0, distance = 0;
  };
  Least pointwise_least(const Piece& piece, const Price& price, int parts) const;
  int regime(double v, double direction, const Price& price) const;
  void integrate(double from, double to, double peak, double direction, const Price& price, int depth,
                 RestMotion& sum) const;

  UniformTask task_;
  std::size_t motors_ = 2;  // that are computed; one where both are alike
  double each_ = 1;         // how many motors each of them represents
  double top_ = 0;          // the speed limit, or the greatest speed at which the motors can still accelerate
  double bare_top_ = 0;     // the greatest speed that they can hold, if it is less than the speed limit
};

}  // namespace joulecast::planning
