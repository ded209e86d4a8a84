#include "planning/uniform_motion.h"

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <limits>
#include <string>

#include "dynamics/stribeck_curve.h"
#include "planning/numerics.h"

namespace joulecast::planning {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double request_rounding = 1e-9;  // relative: of distances and speeds that the request gives
constexpr double spare = 1e-7;             // of the distance: less is spread over the nodes
constexpr double little = 1e-4;            // of the distance: may be driven at the speed of the turn
constexpr int speed_samples = 64;          // where f is looked at for its minima
constexpr int most_cuts =
    8;  // in halves, of a cell in which the acceleration or a motor's limit changes fast
constexpr double overuse = 2e-5;     // of a motor's limit, within a cell
constexpr double least_share = 0.9;  // of a cell's acceleration that motors must allow at its ends

// Whether two motors have equal loads, or mirror images of them, as in a turn in place.
bool alike(const WheelLoad& a, const WheelLoad& b) {
  const double sign = a.pace == b.pace ? 1 : -1;
  const auto same = [&](auto... member) { return ((a.*member == sign * (b.*member)) && ...); };
  return same(&WheelLoad::pace, &WheelLoad::inertia, &WheelLoad::t0, &WheelLoad::t1, &WheelLoad::t2,
              &WheelLoad::f0, &WheelLoad::f1, &WheelLoad::f2, &WheelLoad::stribeck, &WheelLoad::scrub) &&
         a.stribeck_speed == b.stribeck_speed && a.stribeck_exponent == b.stribeck_exponent;
}

}  // namespace

UniformMotion::UniformMotion(const UniformTask& task) : task_(task) {
  if (alike(task.loads[0], task.loads[1]) && task.electric.symmetric()) motors_ = 1, each_ = 2;
}

tl::unexpected<Error> endless(double standing_w) {
  return fail(Fault::infeasible, "value_of_time_w",
              "plus the power at standstill is " + std::to_string(standing_w) +
                  " W, must be positive for a best end time to exist; a deadline_s bounds it too");
}

bool UniformMotion::has_motor_limits() const {
  return std::isfinite(task_.torque_limit_nm) || std::isfinite(task_.voltage_limit_v);
}

UniformMotion::Local UniformMotion::local(double v) const {
  Local l;
  l.v = v;
  for (std::size_t s = 0; s < motors_; ++s) {
    const WheelLoad& w = task_.loads[s];
    l.torque[s] = w.t0 + w.f0 + w.direction(v) * (w.t_dry + w.f_dry) + v * (w.t1 + w.f1 + v * (w.t2 + w.f2));
    if (w.scrub != 0) l.torque[s] += w.scrub * std::tanh(v / w.scrub_speed);
    if (w.stribeck != 0)
      l.torque[s] += w.stribeck * dynamics::stribeck_curve(v / w.stribeck_speed, w.stribeck_exponent);
  }
  return l;
}

UniformMotion::Power UniformMotion::motors(const Local& l, double acceleration) const {
  const Electric& e = task_.electric;
  Power sum;
  for (std::size_t s = 0; s < motors_; ++s) {
    const WheelLoad& w = task_.loads[s];
    const double t = l.torque[s] + w.inertia * acceleration;
    const double emf = e.back_emf * w.pace * l.v, copper = e.copper_w_n2_m2[s];
    double power = (copper * t + emf) * t, slope = 2 * copper * t + emf, bend = 2 * copper;
    power += e.brush_w_nm * std::fabs(t), slope += std::copysign(e.brush_w_nm, t);
    const double share = each_ * (power > 0 ? e.up : e.down);
    sum.w += share * power;
    sum.slope += share * slope * w.inertia;
    sum.bend += share * bend * w.inertia * w.inertia;
  }
  return sum;
}

// The greatest acceleration (direction 1) or braking (-1) that limits allow, motors' by 1 + `tolerance`.
UniformMotion::Most UniformMotion::most(const Local& l, double direction, double tolerance) const {
  Most most{task_.acceleration_limit, Bound::acceleration};
  if (!has_motor_limits()) return most;
  const Electric& e = task_.electric;
  const double torque_limit = task_.torque_limit_nm * (1 + tolerance),
               voltage_limit = task_.voltage_limit_v * (1 + tolerance);
  for (std::size_t s = 0; s < motors_; ++s) {
    const WheelLoad& w = task_.loads[s];
    const double ohm = e.volts_per_nm[s], emf = e.voltage_constant_v_s_rad * w.pace * l.v;
    for (const double side : {-1.0, 1.0}) {
      const double by_voltage = (voltage_limit - side * emf) / ohm;
      const bool by_current = torque_limit <= by_voltage;
      const double torque = side * (by_current ? torque_limit : by_voltage);
      const double room = torque - l.torque[s];
      // Bounded on this side where `direction` pushes towards it.
      const double push = direction * w.inertia * side;
      const double allowed = side * room < 0 ? -1 : push > 0 ? side * room / push : infinite;
      if (allowed < most.acceleration) most = {allowed, by_current ? Bound::current : Bound::voltage};
    }
  }
  return most;
}

// The acceleration of least L/a. Braking that costs (down < 0) makes L concave where motors generate, and
// convex again where braking draws power. L is quadratic between the accelerations at which a motor's torque
// or voltage changes sign: L/a is least at one of these, at the zero of its slope in between, or at the
// limit.
double UniformMotion::best(const Local& l, double direction, double rate_w, double most) const {
  const Electric& e = task_.electric;
  if (e.down >= 0 || !std::isfinite(most)) return level(l, direction, rate_w, most);
  std::array<double, 6> cuts{};
  std::size_t count = 1;
  for (std::size_t s = 0; s < motors_; ++s) {
    const WheelLoad& w = task_.loads[s];
    const double emf = e.back_emf * w.pace * l.v, brush = std::min(e.brush_w_nm, std::fabs(emf));
    for (const double torque : {0.0, (std::copysign(brush, emf) - emf) / e.copper_w_n2_m2[s]}) {
      const double at = (torque - l.torque[s]) / (direction * w.inertia);
      if (!(at > 0 && at < most)) continue;
      std::size_t k = count++;
      for (; cuts[k - 1] > at; --k) cuts[k] = cuts[k - 1];
      cuts[k] = at;
    }
  }
  cuts[count] = most;
  double found = most, least = infinite;
  const auto try_at = [&](double a) {
    const double cost = (motors(l, direction * a).w + rate_w) / a;
    if (cost < least) found = a, least = cost;
  };
  for (std::size_t k = 1; k <= count; ++k) {
    const double middle = 0.5 * (cuts[k - 1] + cuts[k]);
    const Power here = motors(l, direction * middle);
    const double square = 0.5 * here.bend,
                 fixed = here.w + (square * middle - direction * here.slope) * middle;
    const double a =
        std::sqrt(std::max(fixed + rate_w, 1e-14 * (std::fabs(fixed) + std::fabs(rate_w))) / square);
    if (a > cuts[k - 1] && a < cuts[k]) try_at(a);
    try_at(cuts[k]);
  }
  return found;
}

// The zero of a dL/da - L, by Newton's method in a^2 within a bracket: exact where power is quadratic.
double UniformMotion::level(const Local& l, double direction, double rate_w, double most) const {
  Power here;
  const auto excess = [&](double a) {
    here = motors(l, direction * a);
    return a * direction * here.slope - here.w - rate_w;
  };
  double low = 0, high = most, at_low = excess(0);
  at_low = std::min(at_low, -1e-14 * (std::fabs(here.w) + std::fabs(rate_w)));
  if (task_.electric.up != task_.electric.down || task_.electric.brush_w_nm != 0) {
    // Where a motor begins to brake, the slope jumps; the optimum likes to be there, which is coasting.
    for (std::size_t s = 0; s < motors_; ++s) {
      const double kink = -l.torque[s] / (direction * task_.loads[s].inertia);
      if (!(kink > low && kink < high)) continue;
      const Power before = here;
      if (excess(kink * (1 - 1e-10)) > 0) {
        high = kink;
        here = before;
        continue;
      }
      at_low = excess(kink * (1 + 1e-10));
      if (at_low >= 0) return kink;
      low = kink;
    }
  }
  if (here.bend < 0) return high;
  double a = std::clamp(std::sqrt(low * low - 2 * at_low / here.bend), low, high);
  bool at_most = false;
  for (int k = 0; k < 100 && high - low > 1e-12 * low; ++k) {
    at_most = at_most || a == most;
    const double y = excess(a);
    if (y <= 0 && a == most) return most;
    (y <= 0 ? low : high) = a;
    double next = std::sqrt(std::max(0.0, a * a - 2 * y / here.bend));
    if (std::fabs(next - a) <= 1e-12 * a) return a;
    if (next >= most && !at_most)
      next = most;
    else if (!(next > low && next < high) || k % 4 == 3)
      next = std::isfinite(high) ? 0.5 * (low + high) : 2 * low + 1e-3;
    a = next;
  }
  return a;
}

double UniformMotion::cheapest_speed(double fixed_w) const {
  const auto f = [&](double v) { return steady_cost(v, fixed_w); };
  if (f(top_) <= f(top_ * (1 - 1e-7))) return top_;
  constexpr int bits = std::numeric_limits<double>::digits / 2;
  return boost::math::tools::brent_find_minima(f, 1e-9 * top_, top_, bits).first;
}

// The spacing of speeds from the pivot, where the acceleration is least: at y = sinh^2(X j/n) of the
// interval, which is even in time on an extremal with a quadratic L(v, 0).
double UniformMotion::stretch(double pivot, double end, const Price& price) const {
  if (price.fastest) return 2;
  const auto standing = [&](double v) { return motors(local(v), 0).w + price.fixed_w - price.lambda * v; };
  const double at = standing(pivot), half = standing(0.5 * (pivot + end)) - at, whole = standing(end) - at;
  const double linear = 4 * half - whole, square = 2 * whole - 4 * half;
  if (!(square > 0)) return 0.01;
  return std::clamp(std::asinh(std::sqrt(square / std::max(linear, 1e-6 * square))), 0.01, 3.0);
}

UniformMotion::Most UniformMotion::wanted(const Local& l, Most within, double direction,
                                          const Price& price) const {
  within.acceleration = std::max(within.acceleration, 0.0);
  if (price.fastest) return {within.acceleration, within.bound, true};
  const double a = best(l, direction, price.fixed_w - price.lambda * l.v, within.acceleration);
  return {a, within.bound, a >= within.acceleration};
}

UniformMotion::Most UniformMotion::wanted(double v, double direction, const Price& price) const {
  const Local here = local(v);
  return wanted(here, most(here, direction, 0), direction, price);
}

UniformMotion::End UniformMotion::end_at(double v, double direction, const Price& price) const {
  const Local here = local(v);
  const Most allowed = most(here, direction, 0);
  return {v, wanted(here, allowed, direction, price), allowed,
          price.rough ? allowed : most(here, direction, overuse)};
}

// `change` is by how much the acceleration may differ between the ends of a cell; where it jumps within one,
// from braking to coasting, the cell is cut there.
template <class Visit>
void UniformMotion::piece(const End& from, const End& to, double change, const Price& price, int halvings,
                          Visit&& visit) const {
  const double direction = to.v > from.v ? 1 : -1;
  const End cut = end_at(0.5 * (from.v + to.v), direction, price);
  const double before = from.wanted.acceleration, after = to.wanted.acceleration;
  Most at_middle = cut.wanted;
  const auto [least, greatest] = std::minmax({before, at_middle.acceleration, after});
  const bool jumps = greatest > change * least && halvings < most_cuts;
  const double tolerance = price.fastest ? hurried_tolerance : task_.motor_tolerance;
  bool beyond = false;
  if (!price.rough && has_motor_limits()) {
    // In the time that the accelerations within the limits take, by Simpson's rule: of a room that vanishes,
    // the least within each cell would leave too much unused.
    if (at_middle.bounded && at_middle.bound != Bound::acceleration && 2 * least > greatest)
      at_middle.acceleration = 6 / (1 / before + 4 / cut.wanted.acceleration + 1 / after);
    const double mean = at_middle.acceleration;
    for (const End* there : {&from, &cut, &to}) {
      beyond = beyond || there->beyond.acceleration < (1 - tolerance) * mean ||
               there->allowed.acceleration < least_share * cut.wanted.acceleration;
      if (there->beyond.acceleration < at_middle.acceleration)
        at_middle = {std::max(there->beyond.acceleration, 1e-3 * cut.wanted.acceleration),
                     there->beyond.bound, true};
    }
  }
  const bool bends = !price.rough && task_.loads[0].parts(from.v, to.v) > 1;
  if (jumps || ((beyond || bends) && halvings < most_cuts)) {
    piece(from, cut, change, price, halvings + 1, visit);
    piece(cut, to, change, price, halvings + 1, visit);
  } else {
    visit(Piece{from.v, to.v, at_middle.acceleration, at_middle.bound, at_middle.bounded});
  }
}

template <class Visit>
void UniformMotion::leg(double from, double to, bool pivot_at_end, const Price& price, Visit&& visit) const {
  if (from == to) return;
  const double pivot = pivot_at_end ? to : from, far = pivot_at_end ? from : to,
               direction = to > from ? 1 : -1;
  const std::size_t cells = price.rough ? std::max<std::size_t>(8, task_.cells / 4) : task_.cells;
  const double x = stretch(pivot, far, price), whole = std::sinh(x), count = static_cast<double>(cells);
  const bool may_jump = !price.rough && (has_motor_limits() || task_.electric.up != task_.electric.down);
  const auto end = [&](double v) { return may_jump ? end_at(v, direction, price) : End{v, {}, {}, {}}; };
  End last = end(from);
  for (std::size_t j = 1; j <= cells; ++j) {
    const double i = static_cast<double>(pivot_at_end ? cells - j : j);
    const double root = std::sinh(x * i / count) / whole;
    const double v = j == cells ? to : pivot + root * root * (far - pivot);
    const End next = end(v);
    // Towards the pivot the acceleration vanishes as the square root of the remaining speed difference.
    const double least = pivot_at_end ? i : i - 1;
    piece(last, next, may_jump && least > 0 ? 1.5 * (least + 1) / least : infinite, price, 0, visit);
    last = next;
  }
}

template <class Visit>
void UniformMotion::pieces(const Shape& shape, Visit&& visit) const {
  const double v0 = task_.start_speed, v1 = task_.end_speed;
  if (shape.cruises || (shape.middle - v0) * (shape.middle - v1) < 0) {
    leg(v0, shape.middle, true, shape.price, visit);
    leg(shape.middle, v1, false, shape.price, visit);
  } else {
    leg(v0, v1, std::fabs(v1 - shape.middle) < std::fabs(v0 - shape.middle), shape.price, visit);
  }
}

double UniformMotion::distance(Shape& shape) const {
  double sum = 0;
  shape.driven.clear();
  pieces(shape, [&](const Piece& piece) {
    shape.driven.push_back(piece);
    sum += piece.distance();
  });
  return sum;
}

// Finds the speed at which a motion turns, between one that is too near and one that is far enough.
UniformMotion::Shape UniformMotion::turning(Shape shape, double nearest, double farthest) const {
  const auto missing = [&](double v) {
    shape.middle = v;
    if (!shape.price.fastest) shape.price.lambda = steady_cost(v, shape.price.fixed_w);
    return std::log(distance(shape) / task_.distance);
  };
  // Few cells find about where it is, all of them the place.
  shape.price.rough = true;
  double far = farthest, at_far = missing(far);
  double near = nearest, at_near = near > 0 && at_far > 0 ? missing(near) : 0;
  while (near == 0 && at_far > 0) {
    const double v = 0.5 * far, at = missing(v);
    if (at < 0) {
      near = v, at_near = at;
    } else {
      far = v, at_far = at;
    }
  }
  double v = at_far > 0 ? zero_between(missing, near, at_near, far, at_far, 1e-6) : far;
  // Far enough away for the jumps from few cells to be small in comparison.
  const double aside = v - 0.05 * (v - nearest), rough_slope = (missing(v) - missing(aside)) / (v - aside);
  shape.price.rough = false;
  // The rest of the way, if any, is driven at the speed of the turn: the motion must not be too long.
  double m = missing(v), slope = rough_slope;
  // Deadlines are compared with the fastest motion, which is therefore computed more accurately. Otherwise a
  // small part of the way at the speed of the turn costs only the square of its share.
  const double close = shape.price.fastest ? 1e-3 * spare : spare,
               missed = shape.price.fastest ? close : little;
  for (int k = 0; k < 12 && !(m <= close && (m >= -missed || v == farthest || k > 8)); ++k) {
    const double next = v - (m + 0.5 * missed) / slope - (k > 5 ? 1e-4 * (v - nearest) : 0);
    const double v_before = v, m_before = m;
    v = std::clamp(next, std::min(nearest, farthest), std::max(nearest, farthest));
    m = missing(v);
    if (const double share = (m - m_before) / (v - v_before) / rough_slope; share > 0.2 && share < 5)
      slope = share * rough_slope;
  }
  // Where the motors' reserve vanishes towards the top speed, the distance grows far more steeply than a few
  // cells indicate.
  if (m < -little && v != farthest) {
    const double at_farthest = missing(farthest);
    v = at_farthest > 0 ? zero_between(missing, v, m, farthest, at_farthest, 1e-12) : farthest;
    m = missing(v);
  }
  // Cells that are cut where the acceleration jumps make the distance jump a little with the speed.
  if (m > close) {
    double low = v, step = 1e-4 * (v - nearest);
    for (int k = 0; k < 20 && missing(low) > close; ++k, step *= 2)
      low = nearest + std::max(0.0, low - step - nearest);
    missing(last_that([&](double speed) { return missing(speed) <= close; }, low, v, 12));
  }
  return shape;
}

// No turn: lambda is less than where the acceleration would vanish on the way.
std::optional<UniformMotion::Shape> UniformMotion::monotone(Shape shape, double highest_lambda) const {
  shape.cruises = false;
  Shape fast = shape;
  fast.price.fastest = true;
  const double least = distance(fast);
  if (task_.distance < least * (1 - request_rounding)) return std::nullopt;
  if (task_.distance <= least * (1 + request_rounding)) return fast;
  const auto missing = [&](double log_drop) {
    shape.price.lambda = highest_lambda - std::exp(log_drop);
    return -std::log(distance(shape) / task_.distance);
  };
  const double start = std::log(std::fabs(highest_lambda) + 1e-3);
  double low = start, at_low = missing(low), high = low, at_high = at_low;
  for (int k = 0; k < 60 && at_low >= 0; ++k) at_low = missing(low -= 1);
  for (int k = 0; k < 60 && at_high < 0; ++k) at_high = missing(high += 1);
  if (at_low >= 0) return shape;
  if (at_high < 0) return fast;
  missing(zero_between(missing, low, at_low, high, at_high, 0, 1e-12));
  return shape;
}

std::optional<UniformMotion::Shape> UniformMotion::fastest_shape() const {
  const double nearest = std::max(task_.start_speed, task_.end_speed);
  Shape shape;
  shape.price.fastest = true;
  if (nearest > 0) {
    shape.middle = nearest;
    const double least = distance(shape);
    if (task_.distance < least * (1 - request_rounding)) return std::nullopt;
    if (task_.distance <= least * (1 + request_rounding)) return shape;
  }
  return turning(shape, nearest, top_);
}

std::optional<UniformMotion::Shape> UniformMotion::shape_at(double fixed_w) const {
  const double fast = std::max(task_.start_speed, task_.end_speed),
               slow = std::min(task_.start_speed, task_.end_speed), cheapest = cheapest_speed(fixed_w);
  Shape shape;
  shape.price.fixed_w = fixed_w;
  const bool below = fast <= cheapest, above = slow >= cheapest;
  // The speed of an end nearest to the cheapest, where the motion turns if it does not cover the way.
  shape.middle = below ? fast : above ? slow : cheapest;
  if (shape.middle > 0) {
    shape.price.lambda = steady_cost(shape.middle, fixed_w);
    if (distance(shape) > task_.distance) return monotone(shape, shape.price.lambda);
  }
  if (!below && !above) return shape;
  return turning(shape, shape.middle, cheapest);
}

// The integral of the least L/|a| over the speeds of a piece, and the way that such accelerations take.
UniformMotion::Least UniformMotion::pointwise_least(const Piece& piece, const Price& price, int parts) const {
  const double change = piece.to - piece.from, direction = change > 0 ? 1 : -1;
  Least sum;
  for (int part = 0; part < parts; ++part) {
    for (const auto& [at, weight] : gauss3) {
      const Local here = local(piece.from + (part + at) / parts * change);
      const double rate = price.fixed_w - price.lambda * here.v, speeds = weight / parts * std::fabs(change);
      const double bound = std::max(most(here, direction, 0).acceleration, 1e-3 * piece.acceleration);
      const double a = best(here, direction, rate, bound);
      sum.integral_j += speeds * (motors(here, direction * a).w + rate) / a;
      sum.distance += speeds * here.v / a;
    }
  }
  return sum;
}

SteppedMotion UniformMotion::written(const Shape& shape) const {
  SteppedMotion motion;
  const double idle_w = task_.electric.idle_w;
  double covered = 0, way = 0;
  for (const Piece& piece : shape.driven) covered += piece.distance();
  const double cruise =
      shape.cruises && task_.distance > covered * (1 + spare) ? task_.distance - covered : 0;
  covered += cruise;
  // Rounding errors of the distance are absorbed in the spacing of the nodes.
  const double scale = task_.distance / covered;
  motion.way.push_back(0), motion.speed.push_back(task_.start_speed);
  const auto hold = [&] {
    if (!(cruise > 0)) return;
    const double duration = cruise / shape.middle;
    motion.duration_s += duration;
    motion.energy_j += (motors(local(shape.middle), 0).w + idle_w) * duration;
    if (bare_top_ > 0 && shape.middle >= top_ && !shape.price.fastest)
      motion.discretisation_j += std::max(0.0, steady_cost(top_, shape.price.fixed_w) -
                                                   steady_cost(bare_top_, shape.price.fixed_w)) *
                                 cruise;
    // The cost over the distance grows by f(v_turn) a unit, and v_turn by no larger a share than the
    // distance, at most to the cheapest speed.
    if (!shape.price.fastest) {
      const double cheapest = cheapest_speed(shape.price.fixed_w),
                   grown = task_.distance / (task_.distance - cruise),
                   turn = shape.middle < cheapest ? std::min(cheapest, shape.middle * grown)
                                                  : std::max(cheapest, shape.middle / grown);
      motion.discretisation_j += cruise * std::max(0.0, steady_cost(shape.middle, shape.price.fixed_w) -
                                                            steady_cost(turn, shape.price.fixed_w));
    }
    way += cruise;
    motion.way.push_back(way * scale), motion.speed.push_back(shape.middle);
    if (shape.middle >= task_.speed_limit * (1 - request_rounding))
      motion.binding[static_cast<std::size_t>(Bound::speed)] = true;
  };
  bool held = false;
  double best_distance = cruise;
  if (task_.start_speed == shape.middle) hold(), held = true;
  for (const Piece& piece : shape.driven) {
    const double duration = piece.duration_s(), change = piece.to - piece.from;
    const auto power_w = [&](const Local& here) {
      return motors(here, std::copysign(piece.acceleration, change)).w;
    };
    double power = 0, least = 0;
    const bool lossy = task_.electric.up != task_.electric.down;
    const int parts = lossy ? parts_of_turn(power_w(local(piece.from)), power_w(local(piece.to)), idle_w) : 1;
    for (int part = 0; part < parts; ++part) {
      for (const auto& [at, weight] : gauss3) {
        const Local here = local(piece.from + (part + at) / parts * change);
        const double motor_w = power_w(here);
        power += weight / parts * motor_w;
        least += weight / parts * (motor_w + shape.price.fixed_w - shape.price.lambda * here.v);
      }
    }
    motion.duration_s += duration * scale;
    motion.energy_j += (power + idle_w) * duration * scale;
    if (!shape.price.fastest) {
      const Least best = pointwise_least(piece, shape.price, parts);
      motion.discretisation_j += std::max(0.0, least * duration - best.integral_j);
      best_distance += best.distance;
    }
    if (piece.bounded) motion.binding[static_cast<std::size_t>(piece.bound)] = true;
    way += piece.distance();
    motion.way.push_back(way * scale), motion.speed.push_back(piece.to);
    if (!held && piece.to == shape.middle) hold(), held = true;
  }
  motion.way.back() = task_.distance;
  // Those least integrals are of the best motion over another distance: lambda, which is the cost of a unit
  // of it more, is that of the speed there, which changes by no larger a share than the distance.
  if (shape.cruises && !shape.price.fastest && best_distance > 0) {
    const double off = std::fabs(task_.distance - best_distance), share = std::min(0.5, off / best_distance);
    motion.discretisation_j +=
        off *
        std::max(0.0, steady_cost(shape.middle * (1 - share), shape.price.fixed_w) - shape.price.lambda);
  }
  return motion;
}

std::optional<UniformMotion> UniformMotion::make(const UniformTask& task) {
  UniformMotion motion(task);
  const bool bounded = std::isfinite(task.acceleration_limit) || motion.has_motor_limits();
  if ((!bounded && !(task.electric.down > 0)) || task.loads[0].gear != 0 || task.loads[1].gear != 0)
    return std::nullopt;
  // At the top speed a small part of the reserve after friction must be left for acceleration.
  const double room = last_that(
      [&](double share) { return motion.most(motion.local(0), 1, -share).acceleration > 0; }, 0, 1, 30);
  double left = 0.5 * hurried_tolerance * room;
  const auto holds = [&](double v) { return motion.most(motion.local(v), 1, -left).acceleration > 0; };
  for (int k = 0; k < 30 && !holds(0); ++k) left *= 0.5;
  if (!holds(0)) return std::nullopt;
  motion.top_ = task.speed_limit;
  double last = 0;
  for (int k = 1; k <= speed_samples; ++k) {
    const double v = task.speed_limit * k / speed_samples;
    if (!holds(v)) {
      motion.top_ = last_that(holds, last, v, 60);
      left = 0;
      motion.bare_top_ = last_that(holds, motion.top_, v, 60);
      break;
    }
    last = v;
  }
  // v^2 f'(v) = P'(v) v - P(v) less the price must cross zero once for any price above -P(0): it must not
  // fall where it exceeds its value at 0. Between samples it is computed from the chord. Scrub rises first.
  std::vector<double> speeds;
  for (int k = 0; k <= speed_samples; ++k) speeds.push_back(motion.top_ * k / speed_samples);
  for (double v = 4 * task.loads[0].scrub_speed;
       task.loads[0].scrub != 0 && v > 0.05 * task.loads[0].scrub_speed; v *= 0.7)
    if (v < motion.top_) speeds.push_back(v);
  std::ranges::sort(speeds);
  const auto steady_w = [&](double v) { return motion.motors(motion.local(v), 0).w; };
  double greatest = -steady_w(0);
  for (std::size_t k = 1; k < speeds.size(); ++k) {
    const double low = steady_w(speeds[k - 1]), high = steady_w(speeds[k]),
                 here = (high - low) / (speeds[k] - speeds[k - 1]) * speeds[k] - high;
    if (here < greatest - 1e-7 * (std::fabs(low) + std::fabs(high)) && greatest > -steady_w(0))
      return std::nullopt;
    greatest = std::max(greatest, here);
  }
  for (double* speed : {&motion.task_.start_speed, &motion.task_.end_speed}) {
    if (*speed > motion.top_ * (1 + request_rounding)) return std::nullopt;
    *speed = std::min(*speed, motion.top_);
  }
  return motion;
}

double UniformMotion::shortest_s() const {
  const auto shape = fastest_shape();
  return shape ? written(*shape).duration_s : infinite;
}

// Which limit holds the acceleration, if any, which motors brake or coast, and how far scrub has built up.
int UniformMotion::regime(double v, double direction, const Price& price) const {
  const Most at = wanted(v, direction, price);
  const Local here = local(v);
  // Where scrub builds up, by parts.
  const WheelLoad& first = task_.loads[0];
  int flows = first.scrub != 0 && v < 4 * first.scrub_speed ? 1 + static_cast<int>(v / first.scrub_speed) : 0;
  for (std::size_t s = 0; s < motors_; ++s) {
    const WheelLoad& w = task_.loads[s];
    const double inertial = w.inertia * direction * at.acceleration, torque = here.torque[s] + inertial;
    const double coasting = 1e-6 * (std::fabs(here.torque[s]) + std::fabs(inertial));
    flows = 3 * flows + (torque * w.pace > coasting ? 2 : torque * w.pace < -coasting ? 0 : 1);
  }
  return 45 * (at.bounded ? 1 + static_cast<int>(at.bound) : 0) + flows;
}

// Over y in v = peak (1 - y^2), in which the acceleration does not vanish as a root at the peak.
void UniformMotion::integrate(double from, double to, double peak, double direction, const Price& price,
                              int depth, RestMotion& sum) const {
  constexpr double near_peak = 1e-6;
  const auto speed = [&](double y) { return peak * (1 - y * y); };
  const auto regime_at = [&](double y) {
    return regime(speed(std::clamp(y, near_peak, 1.0)), direction, price);
  };
  if (const int first = regime_at(from); depth > 0 && regime_at(to) != first) {
    const double cut = last_that([&](double y) { return regime_at(y) == first; }, from, to, 12);
    integrate(from, cut, peak, direction, price, 0, sum);
    integrate(cut + (to - from) / 4096, to, peak, direction, price, depth - 1, sum);
    return;
  }
  for (const auto& [at, weight] : gauss4) {
    const double y = from + at * (to - from), v = speed(y), a = wanted(v, direction, price).acceleration;
    const double seconds = weight * (to - from) * 2 * peak * y / a;
    sum.duration_s += seconds;
    sum.distance += v * seconds;
    sum.energy_j += (motors(local(v), direction * a).w + task_.electric.idle_w) * seconds;
  }
}

RestMotion UniformMotion::to_peak(double peak, double price_w) const {
  Price price;
  price.fixed_w = task_.electric.idle_w + price_w;
  price.lambda = steady_cost(peak, price.fixed_w);
  constexpr int panels = 6;
  RestMotion sum;
  for (const double direction : {1.0, -1.0})
    for (int k = 0; k < panels; ++k)
      integrate(static_cast<double>(k) / panels, static_cast<double>(k + 1) / panels, peak, direction, price,
                7, sum);
  return sum;
}

Result<SteppedMotion> UniformMotion::solve(double price_w) const {
  const double fixed_w = task_.electric.idle_w + price_w, standing_w = motors(local(0), 0).w + fixed_w;
  if (!(standing_w > 0)) return endless(standing_w);
  const auto shape = shape_at(fixed_w);
  if (!shape) return fail(Fault::infeasible, "path", "the way is too short for the end speeds");
  return written(*shape);
}

std::optional<SteppedMotion> UniformMotion::fastest() const {
  const auto shape = fastest_shape();
  if (!shape) return std::nullopt;
  for (const double direction : {-1.0, 1.0})
    if (!std::isfinite(most(local(0.5 * top_), direction, 0).acceleration)) return std::nullopt;
  return written(*shape);
}

}  // namespace joulecast::planning
