#include "plausibility/observation.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace joulecast::plausibility {
namespace {

using signals::Sample;

constexpr std::size_t block_cells = 3;
constexpr std::size_t most_fitted = 512;  // blocks; more do not improve the estimate of their scatter
constexpr double hold_s = 1.0;            // for which positions and yaw rates replace missing ones
constexpr double turning_share = 0.1;  // difference of the wheels over their sum, from which on a robot turns
constexpr double least_way_rad = 0.2;  // of a span, sum of both wheels
constexpr double turning_rad = 0.3;    // difference of the wheels' angles in a span
constexpr double braking_share = 0.05;  // of the fastest wheel speed, decrease in a span
constexpr double map_moving_part =
    0.1;  // of the fastest speed; far beyond the noise of a map's readings in a span
constexpr double map_jump =
    3;  // times the fastest speed: beyond, the map relocalised itself, or has other units
constexpr double reversal = 1.5;  // of a counter that overflows: from its highest reading to its lowest is 2
constexpr double alike_steps = 0.8;       // as alike_leaps of their check
constexpr double leap_accelerations = 3;  // times the file's limit, which is for usual driving
constexpr double widest_turn_rad = 2.0;   // of a span, for the comparison of its chord with its path

// Replaces a missing value by 0, where one of two quantities that are evaluated separately may be missing.
double or_zero(double value) {
  return std::isfinite(value) ? value : 0.0;
}

Relation right_or_left(Relation right, std::size_t side) {
  return static_cast<Relation>(static_cast<std::size_t>(right) + side);
}

}  // namespace

Observer::Observer(const robot::RobotModel& robot, const dynamics::DriveModel& drive, bool delays)
    : robot_(robot),
      model_(drive),
      limit_rad_s_(robot.limits.speed_m_s / robot.kinematics.wheel_radius_m),
      delays_(delays) {}

void Observer::begin(std::string mission_id, double declared_payload_kg) {
  seen_ = {};
  seen_.mission_id = std::move(mission_id);
  cells_.emplace(limit_rad_s_, declared_payload_kg);
  spans_ = {};
  cells_in_block_ = 0;
  before_.reset();
  waiting_.reset();
  known_ = {};
}

// More than the speed limit within a row, or a reversal at speed: no stop and no start.
bool Observer::leaps(double from_rad_s, double to_rad_s, std::int64_t elapsed_us) const {
  const double step_rad_s = std::fabs(to_rad_s - from_rad_s);
  const double from_or_to_rest_rad_s = std::max(std::fabs(from_rad_s), std::fabs(to_rad_s));
  const double most_m_s2 = leap_accelerations * robot_.limits.acceleration_m_s2;
  return step_rad_s > std::min(limit_rad_s_, reversal * from_or_to_rest_rad_s) &&
         step_rad_s * robot_.kinematics.wheel_radius_m > most_m_s2 * 1e-6 * static_cast<double>(elapsed_us);
}

void Observer::add(const Sample& sample) {
  seen_.clock.add(sample.utime_us, sample.sequence);
  const auto readings = signals::numbers_of(sample);
  for (std::size_t k = 0; k < reading_count; ++k) seen_.values[k].add(*readings[k]);
  if (!std::isfinite(sample.wheel_velocity_rad_s[0] + sample.wheel_velocity_rad_s[1])) return;
  if (delays_) seen_.lags.add(sample);
  if (waiting_) {
    Sample s = *waiting_;
    if (before_) {
      for (std::size_t k : {0u, 1u}) {
        const double b = before_->wheel_velocity_rad_s[k], a = sample.wheel_velocity_rad_s[k];
        const double w = s.wheel_velocity_rad_s[k], leap = std::fabs(w - b);
        // Shorter ones than the farthest are noise.
        if (leap > alike_steps * seen_.farthest_leap_rad_s && std::fabs(a - b) > 0.5 * leap &&
            leaps(b, w, s.utime_us - before_->utime_us)) {
          const bool farther = alike_steps * leap > seen_.farthest_leap_rad_s;
          seen_.leaps = farther ? 1 : seen_.leaps + 1;
          seen_.least_leap_rad_s = farther ? leap : std::min(seen_.least_leap_rad_s, leap);
          seen_.farthest_leap_rad_s = std::max(seen_.farthest_leap_rad_s, leap);
        }
        if (is_spike(b, s.wheel_velocity_rad_s[k], a)) s.wheel_velocity_rad_s[k] = 0.5 * (a + b);
      }
      if (is_spike(before_->battery_voltage_v, s.battery_voltage_v, sample.battery_voltage_v)) {
        s.battery_voltage_v = 0.5 * (before_->battery_voltage_v + sample.battery_voltage_v);
      }
    }
    before_ = s;
    take(s);
  }
  waiting_ = sample;
}

void Observer::take(Sample s) {
  if (const auto cell = cells_->add(s)) take(*cell);
  // Positions and gyros may have a lower rate than other readings.
  const bool fresh = 1e-6 * static_cast<double>(s.utime_us - known_us_) <= hold_s;
  if (std::isfinite(s.pose[0] + s.pose[1])) {
    known_.pose = s.pose;
    known_us_ = s.utime_us;
  } else if (fresh) {
    s.pose = known_.pose;
  }
  if (!std::isfinite(s.yaw_rate_rad_s) && fresh) s.yaw_rate_rad_s = known_.yaw_rate_rad_s;
  known_.yaw_rate_rad_s = s.yaw_rate_rad_s;
  if (const auto span = spans_.add(s)) take(*span);
}

void Observer::take(const Cell& c) {
  const double right = c.speed_rad_s[0], left = c.speed_rad_s[1];
  const double common = 0.5 * (c.acceleration_rad_s2[0] + c.acceleration_rad_s2[1]);
  const double difference = 0.5 * (c.acceleration_rad_s2[0] - c.acceleration_rad_s2[1]);
  const bool turning = std::fabs(right - left) > turning_share * (std::fabs(right) + std::fabs(left));
  for (std::size_t k : {0u, 1u}) {
    if (c.way[k] == 0) continue;
    const double w = c.speed_rad_s[k], i = c.current_a[k], v = c.voltage_v[k], way = c.way[k];
    const double slip = !turning ? 0.0 : w > c.speed_rad_s[1 - k] ? 1.0 : -1.0;
    of(right_or_left(Relation::armature_right, k)).add({v, i, w, way, c.acceleration_rad_s2[k]});
    of(right_or_left(Relation::torque_right, k))
        .add({i, way, w, common, k == 0 ? difference : -difference, slip});
    of(right_or_left(Relation::ways_right, k))
        .add({or_zero(i), or_zero(v), way > 0 ? 1.0 : 0.0, way < 0 ? 1.0 : 0.0});
  }
  const bool moves = c.way[0] != 0 || c.way[1] != 0;
  if (moves && !turning && c.way[0] == c.way[1])
    of(Relation::siblings).add({c.way[0] * c.current_a[0], c.way[0] * c.current_a[1], 1.0});
  if (moves) {
    of(Relation::armature_difference)
        .add(
            {c.voltage_v[0] - c.voltage_v[1], c.current_a[0] - c.current_a[1], right - left, 2 * difference});
  }
  if (!c.resting) of(Relation::gyro).add({c.yaw_rate_rad_s, right, left, 1.0});
  const dynamics::Parameters<double>& p = model_.parameters();
  const double speed = 0.5 * (p.wheel_radius_m[0] * right + p.wheel_radius_m[1] * left);
  const double turn = (p.wheel_radius_m[0] * right - p.wheel_radius_m[1] * left) / (2 * p.half_track_m);
  of(Relation::way).add({speed, std::fabs(speed), 1.0});
  of(Relation::back_emf)
      .add({c.voltage_v[0] - p.resistance_ohm[0] * c.current_a[0],
            c.voltage_v[1] - p.resistance_ohm[1] * c.current_a[1], 1.0});
  of(Relation::yaw).add({c.yaw_rate_rad_s, 1.0});
  of(Relation::commanded)
      .add({c.battery_power_w,
            (std::fabs(c.command[0]) + p.half_track_m * std::fabs(or_zero(c.command[1]))) /
                robot_.kinematics.wheel_radius_m,
            1.0});
  of(Relation::command)
      .add({p.wheel_radius_m[0] * right, p.wheel_radius_m[1] * left, c.command[0], or_zero(c.command[1])});
  of(Relation::command_turn).add({turn, c.command[1]});
  take_power(c);
  seen_.fastest_m_s = std::max(seen_.fastest_m_s, std::fabs(speed));
  if (std::isfinite(c.yaw_rate_rad_s)) {
    seen_.fastest_turn_rad_s = std::max(seen_.fastest_turn_rad_s, std::fabs(c.yaw_rate_rad_s));
  }
  if (moves) seen_.moving_s += c.length_s;
  if (++cells_in_block_ == block_cells) {
    cells_in_block_ = 0;
    for (Products& products : seen_.relations) products.next_block();
  }
}

void Observer::take_power(const Cell& c) {
  dynamics::Instant at;
  at.wheel_speed_rad_s = c.speed_rad_s;
  at.wheel_acceleration_rad_s2 = c.acceleration_rad_s2;
  at.payload_kg = c.payload_kg;
  const auto flow = model_.flow(at);
  const double modelled = flow.battery_power_w, moving = modelled - flow.ledger[signals::Term::accessories];
  of(Relation::motors).add({c.battery_power_w, c.motor_power_w, 1.0});
  of(Relation::motion).add({c.battery_power_w, moving, 1.0});
  if (c.resting) of(Relation::idle).add({c.battery_power_w, 1.0});
  if (c.way[0] == 0 && c.way[1] == 0) return;
  const double speed = 0.5 * robot_.kinematics.wheel_radius_m * (c.speed_rad_s[0] + c.speed_rad_s[1]);
  const double weight = robot_.total_mass_kg(c.payload_kg) * robot::standard_gravity_m_s2;
  const double climb = weight * speed * std::sin(c.pitch_rad);
  of(Relation::climb).add({c.battery_power_w - modelled, climb, 1.0});
  if (flow.ledger[signals::Term::kinetic] < 0) return;
  of(Relation::driving)
      .add({c.battery_power_w, modelled, 1.0, c.battery_power_w - std::min(or_zero(climb), 0.0)});
}

void Observer::take(const Span& s) {
  const double right = s.turned_rad[0], left = s.turned_rad[1];
  if (std::isfinite(s.distance)) {
    const double part = s.distance / (robot_.limits.speed_m_s * s.length_s);
    if (part < map_jump) (part > map_moving_part ? seen_.map_moving_s : seen_.map_standing_s) += s.length_s;
  }
  if (std::fabs(right) + std::fabs(left) < least_way_rad) return;
  of(Relation::heading_gyro).add({s.heading_rad, s.heading_deg, s.gyro_rad, s.length_s});
  of(Relation::heading_wheels).add({s.heading_rad, s.heading_deg, right, left});
  const double path = 0.5 * robot_.kinematics.wheel_radius_m * (right + left);
  const double by_wheels =
      robot_.kinematics.wheel_radius_m * (right - left) / (2 * robot_.kinematics.half_track_m);
  const double turn = std::isfinite(s.gyro_rad)      ? s.gyro_rad
                      : std::isfinite(s.heading_rad) ? s.heading_rad
                                                     : by_wheels;
  if (std::fabs(turn) > widest_turn_rad) return;
  // The chord of an arc is sin(x)/x times the path, x being half the turn.
  const double half = 0.5 * turn, chord = std::fabs(half) > 1e-6 ? std::sin(half) / half : 1.0;
  of(Relation::travel).add({s.forward / chord, s.sideways / chord, right, left});
  of(Relation::distance).add({s.distance / chord, std::fabs(path)});
  const bool turns = std::fabs(right - left) > turning_rad;
  const bool brakes = std::fabs(s.end_rad_s) < std::fabs(s.begin_rad_s) - braking_share * limit_rad_s_;
  of(Relation::slip)
      .add({s.forward / chord, path, turns ? path : 0.0, brakes ? path : 0.0,
            robot_.kinematics.wheel_radius_m * (s.end_rad_s - s.begin_rad_s)});
}

Observation Observer::finish() {
  if (waiting_) take(*waiting_);
  waiting_.reset();
  for (Products& products : seen_.relations) products.finish();
  if (delays_) seen_.lags.finish();
  return std::move(seen_);
}

Observation Observer::so_far() const {
  Observation seen = seen_;
  for (Products& products : seen.relations) products.finish();
  return seen;
}

std::vector<Products::Block> blocks_of(std::span<const Observation> observations, Relation relation) {
  std::size_t count = 0;
  for (const Observation& o : observations) count += o.of(relation).blocks().size();
  const std::size_t together = std::max<std::size_t>(1, (count + most_fitted - 1) / most_fitted);
  std::vector<Products::Block> blocks;
  std::size_t k = 0;
  for (const Observation& o : observations) {
    for (const Products::Block& block : o.of(relation).blocks()) {
      if (k++ % together == 0)
        blocks.push_back(block);
      else
        blocks.back().join(block);
    }
  }
  return blocks;
}

std::optional<Delay> delay_of(std::span<const Observation> observations, std::span<const Late> channels) {
  std::vector<const LagSums*> sums;
  for (const Observation& o : observations) sums.push_back(&o.lags);
  return delay_between(sums, channels);
}

double least_delay_s(std::span<const Observation> observations, std::initializer_list<std::size_t> readings) {
  double least = 0;
  for (const Observation& o : observations) {
    std::size_t held = std::max(o.of(0).held_rows(), o.of(1).held_rows());
    for (const std::size_t k : readings) held = std::max(held, o.of(k).held_rows());
    least = std::max(least, o.clock.period_s() * (1.5 + (held > 1 ? 0.5 * static_cast<double>(held) : 0)));
  }
  return least;
}

Observation observe(const telemetry::Recording& mission, const robot::RobotModel& robot,
                    const dynamics::DriveModel& drive) {
  Observer observer(robot, drive);
  observer.begin(mission.mission_id, mission.payload_kg);
  for (const Sample& sample : mission.samples) observer.add(sample);
  return observer.finish();
}

}  // namespace joulecast::plausibility
