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
constexpr double leap_accelerations = 3;  // times the file's limit, which is for usual driving
constexpr double spike_share = 0.2;       // of the largest value so far or usual; level around a spike
constexpr double widest_turn_rad = 2.0;   // of a span, for the comparison of its chord with its path

constexpr std::size_t wr = reading::wheel_velocity, wl = wr + 1, vr = reading::motor_voltage, vl = vr + 1,
                      ir = reading::motor_current, il = ir + 1, vb = reading::battery_voltage,
                      ib = reading::battery_current;

// Replaces a missing value by 0, where one of two quantities that are evaluated separately may be missing.
double or_zero(double value) {
  return std::isfinite(value) ? value : 0.0;
}

robot::RobotModel on_wheels(robot::RobotModel robot, double times) {
  robot.kinematics.wheel_radius_m *= times;
  return robot;
}

}  // namespace

dynamics::DriveModel drive_of(const robot::RobotModel& robot) {
  const auto effects = dynamics::active_effects(robot);
  return {robot, effects ? *effects : std::vector<dynamics::ActiveEffect>{}};
}

Observer::Observer(const robot::RobotModel& robot, const dynamics::DriveModel& drive)
    : robot_(robot),
      model_(drive),
      larger_(drive_of(on_wheels(robot, 2))),
      smaller_(drive_of(on_wheels(robot, 0.5))),
      limit_rad_s_(robot.limits.speed_m_s / robot.kinematics.wheel_radius_m) {}

void Observer::begin(std::string mission_id, double declared_payload_kg) {
  seen_ = {};
  seen_.mission_id = std::move(mission_id);
  cells_.emplace(limit_rad_s_, declared_payload_kg);
  spans_ = {};
  cells_in_block_ = 0;
  battery_.fill(signals::unmeasured);
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
  if (waiting_) {
    Sample s = *waiting_;
    if (before_) repair(s, sample);
    before_ = s;
    take(s);
  }
  waiting_ = sample;
}

// Counts leaps and spikes of the sample after before_, and replaces spikes by the level around them.
void Observer::repair(Sample& sample, const Sample& after) {
  const auto readings = signals::numbers_of(sample);
  const auto befores = signals::numbers_of(*before_);
  const auto afters = signals::numbers_of(after);
  for (const std::size_t k :
       {reading::wheel_velocity, reading::wheel_velocity + 1, reading::battery_voltage}) {
    const bool wheel = k != reading::battery_voltage;
    double& value = *readings[k];
    const double b = *befores[k], a = *afters[k], level = 0.5 * (a + b), step = std::fabs(value - b);
    // Shorter ones than the farthest are noise.
    if (wheel && step > alike_leaps * seen_.farthest_leap_rad_s && std::fabs(a - b) > 0.5 * step &&
        leaps(b, value, sample.utime_us - before_->utime_us)) {
      const bool farther = alike_leaps * step > seen_.farthest_leap_rad_s;
      seen_.leaps = farther ? 1 : seen_.leaps + 1;
      seen_.least_leap_rad_s = farther ? step : std::min(seen_.least_leap_rad_s, step);
      seen_.farthest_leap_rad_s = std::max(seen_.farthest_leap_rad_s, step);
    }
    if (!is_spike(b, value, a)) continue;
    const double largest = std::max(seen_.values[k].high(), -seen_.values[k].low());
    if (std::fabs(level) >
        spike_share * std::max(largest, wheel ? limit_rad_s_ : robot_.battery.nominal_voltage_v))
      ++seen_.spikes[k];
    value = level;
  }
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

void Observer::relate(Relation relation, std::initializer_list<std::size_t> readings,
                      std::initializer_list<double> row,
                      std::initializer_list<std::initializer_list<double>> noise) {
  const auto k = static_cast<std::size_t>(relation);
  seen_.relations[k].add(row, noise);
  for (const std::size_t reading : readings) seen_.readings[k] |= 1u << reading;
}

void Observer::take(const Cell& c) {
  using namespace reading;
  using R = Relation;
  const dynamics::Parameters<double>& p = model_.parameters();
  const std::array<double, reading_count>& z = c.mean;
  const std::array<double, motor_readings>& e = c.noise;
  const double common = 0.5 * (c.acceleration_rad_s2[0] + c.acceleration_rad_s2[1]);
  const double difference = 0.5 * (c.acceleration_rad_s2[0] - c.acceleration_rad_s2[1]);
  const bool turning = std::fabs(z[wr] - z[wl]) > turning_share * (std::fabs(z[wr]) + std::fabs(z[wl]));
  const bool moves = c.way[0] != 0 || c.way[1] != 0;
  for (std::size_t k : {0u, 1u}) {
    if (c.way[k] == 0) continue;
    const double w = z[wr + k], way = c.way[k], slip = !turning ? 0.0 : w > z[wl - k] ? 1.0 : -1.0;
    relate(of_side(R::armature_right, k), {wr + k, vr + k, ir + k},
           {z[vr + k], z[ir + k], w, way, c.acceleration_rad_s2[k], 1.0},
           {{e[vr + k], e[ir + k], e[wr + k], 0, 0, 0}, {0, 0, 0, 0, c.acceleration_noise[k], 0}});
    relate(of_side(R::torque_right, k), {wr + k, ir + k},
           {z[ir + k], way, w, common, k == 0 ? difference : -difference, slip, 1.0});
  }
  if (moves && !turning && c.way[0] == c.way[1])
    relate(R::siblings, {wr, wl, ir, il}, {c.way[0] * z[ir], c.way[0] * z[il], 1.0});
  if (moves)
    relate(R::armature_difference, {wr, wl, vr, vl, ir, il},
           {z[vr] - z[vl], z[ir] - z[il], z[wr] - z[wl], 2 * difference},
           {{e[vr] - e[vl], e[ir] - e[il], e[wr] - e[wl], 0},
            {0, 0, 0, c.acceleration_noise[0] - c.acceleration_noise[1]}});
  if (!c.resting) relate(R::gyro, {wr, wl, yaw_rate}, {z[yaw_rate], z[wr], z[wl], 1.0});
  const double right_m_s = p.wheel_radius_m[0] * z[wr], left_m_s = p.wheel_radius_m[1] * z[wl];
  const double speed = 0.5 * (right_m_s + left_m_s), turn = or_zero(z[command_turn]);
  const double fastest_m_s = std::fabs(z[command_speed]) + p.half_track_m * std::fabs(turn);
  relate(R::way, {wr, wl}, {speed, std::fabs(speed), 1.0});
  relate(R::back_emf, {vr, vl, ir, il},
         {z[vr] - p.resistance_ohm[0] * z[ir], z[vl] - p.resistance_ohm[1] * z[il], 1.0});
  relate(R::yaw, {yaw_rate}, {z[yaw_rate], 1.0});
  relate(R::commanded, {vb, ib, command_speed},
         {c.battery_power_w, fastest_m_s / robot_.kinematics.wheel_radius_m, 1.0});
  relate(R::command, {wr, wl, command_speed}, {right_m_s, left_m_s, z[command_speed], turn});
  relate(R::command_turn, {wr, wl, command_turn},
         {(right_m_s - left_m_s) / (2 * p.half_track_m), z[command_turn]});
  take_power(c);
  seen_.fastest_m_s = std::max(seen_.fastest_m_s, std::fabs(speed));
  seen_.fastest_turn_rad_s = std::max(seen_.fastest_turn_rad_s, std::fabs(or_zero(z[yaw_rate])));
  if (moves) seen_.moving_s += c.length_s;
  if (++cells_in_block_ < block_cells) return;
  cells_in_block_ = 0;
  for (Products& products : seen_.relations) products.next_block();
}

void Observer::take_power(const Cell& c) {
  dynamics::Instant at;
  at.wheel_speed_rad_s = {c.mean[0], c.mean[1]};
  at.wheel_acceleration_rad_s2 = c.acceleration_rad_s2;
  at.payload_kg = c.mean[reading::payload];
  const auto flow = model_.flow(at);
  const double modelled = flow.battery_power_w, idle = flow.ledger[signals::Term::accessories];
  relate(Relation::motors, {vb, ib, vr, vl, ir, il}, {c.battery_power_w, c.motor_power_w, 1.0});
  relate(Relation::motion, {wr, wl, vb, ib}, {c.battery_power_w, modelled, 1.0});
  const double current_change = c.mean[ib] - battery_[1];
  const bool charged = std::max(battery_[2], modelled) < 0;
  relate(Relation::sag, {vb, ib}, {c.mean[vb] - battery_[0], current_change, charged ? current_change : 0.0});
  battery_ = {c.mean[vb], c.mean[ib], modelled};
  if (c.resting) relate(Relation::idle, {wr, wl, vb, ib}, {c.battery_power_w, 1.0});
  if (c.way[0] == 0 && c.way[1] == 0) return;
  const double speed = 0.5 * robot_.kinematics.wheel_radius_m * (c.mean[wr] + c.mean[wl]);
  const double weight = robot_.total_mass_kg(at.payload_kg) * robot::standard_gravity_m_s2;
  const double climb = weight * speed * std::sin(c.mean[reading::pitch]);
  relate(Relation::climb, {wr, wl, vb, ib, reading::pitch}, {c.battery_power_w - modelled, climb, 1.0});
  if (flow.ledger[signals::Term::kinetic] < 0) return;
  const double larger = larger_.flow(at).battery_power_w, smaller = smaller_.flow(at).battery_power_w;
  at.wheel_acceleration_rad_s2 = {};
  const auto steady_w = [&](const dynamics::DriveModel& m) { return m.flow(at).battery_power_w - idle; };
  const double steady = steady_w(model_), on_larger = steady_w(larger_), on_smaller = steady_w(smaller_);
  for (double& w : at.wheel_speed_rad_s) w *= 0.5;
  relate(Relation::driving, {wr, wl, vb, ib},
         {c.battery_power_w, modelled, 1.0, c.battery_power_w - std::min(or_zero(climb), 0.0), steady,
          modelled - idle - steady, or_zero(climb), std::fabs(c.mean[wr] - c.mean[wl]), steady_w(model_),
          on_larger, larger - idle - on_larger, on_smaller, smaller - idle - on_smaller});
}

void Observer::take(const Span& s) {
  using namespace reading;
  const double right = s.turned_rad[0], left = s.turned_rad[1], radius_m = robot_.kinematics.wheel_radius_m;
  if (std::isfinite(s.distance)) {
    const double part = s.distance / (robot_.limits.speed_m_s * s.length_s);
    if (part < map_jump) (part > map_moving_part ? seen_.map_moving_s : seen_.map_standing_s) += s.length_s;
  }
  if (std::fabs(right) + std::fabs(left) < least_way_rad) return;
  relate(Relation::heading_gyro, {heading, yaw_rate}, {s.heading_rad, s.heading_deg, s.gyro_rad, s.length_s});
  relate(Relation::heading_wheels, {heading, wr, wl}, {s.heading_rad, s.heading_deg, right, left});
  const double path = 0.5 * radius_m * (right + left);
  const double by_wheels = radius_m * (right - left) / (2 * robot_.kinematics.half_track_m);
  const double turn = std::isfinite(s.gyro_rad)      ? s.gyro_rad
                      : std::isfinite(s.heading_rad) ? s.heading_rad
                                                     : by_wheels;
  if (std::fabs(turn) > widest_turn_rad) return;
  // The chord of an arc is sin(x)/x times the path, x being half the turn.
  const double half = 0.5 * turn, chord = std::fabs(half) > 1e-6 ? std::sin(half) / half : 1.0;
  relate(Relation::distance, {x, y, wr, wl}, {s.distance / chord, std::fabs(path)});
  const bool turns = std::fabs(right - left) > turning_rad;
  const bool brakes = std::fabs(s.end_rad_s) < std::fabs(s.begin_rad_s) - braking_share * limit_rad_s_;
  relate(Relation::slip, {x, y, heading, wr, wl},
         {s.forward / chord, path, turns ? path : 0.0, brakes ? path : 0.0,
          radius_m * (s.end_rad_s - s.begin_rad_s)});
}

Observation Observer::finish() {
  if (waiting_) take(*waiting_);
  waiting_.reset();
  for (Products& products : seen_.relations) products.finish();
  return std::move(seen_);
}

Observation Observer::so_far() const {
  Observation seen = seen_;
  for (Products& products : seen.relations) products.finish();
  return seen;
}

Observation observe(const telemetry::Recording& mission, const robot::RobotModel& robot,
                    const dynamics::DriveModel& drive) {
  Observer observer(robot, drive);
  observer.begin(mission.mission_id, mission.payload_kg);
  for (const Sample& sample : mission.samples) observer.add(sample);
  return observer.finish();
}

std::vector<Products::Block> blocks_of(std::span<const Observation> observations, Relation relation,
                                       std::uint32_t silent) {
  const auto at = static_cast<std::size_t>(relation);
  std::size_t count = 0;
  for (const Observation& o : observations) {
    if ((o.readings[at] & silent) != 0) return {};
    count += o.relations[at].blocks().size();
  }
  const std::size_t together = std::max<std::size_t>(1, (count + most_fitted - 1) / most_fitted);
  std::vector<Products::Block> blocks;
  std::size_t k = 0;
  for (const Observation& o : observations) {
    for (const Products::Block& block : o.relations[at].blocks()) {
      if (k++ % together == 0)
        blocks.push_back(block);
      else
        blocks.back().join(block);
    }
  }
  return blocks;
}

}  // namespace joulecast::plausibility
