#include "plausibility/delays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "plausibility/evaluation.h"
#include "statistics/bootstrap.h"
#include "windows/track.h"

namespace joulecast::plausibility {
namespace {

constexpr double finest_s = 0.04;     // step; fine enough for delays of tens of ms
constexpr double longest_gap = 3;     // steps
constexpr double slope_s = 0.1;       // to each side, for accelerations
constexpr double start_s = 0.3;       // to each side without standstill; there currents precede motion
constexpr double moving_rad_s = 0.4;  // sum of both wheels
constexpr double alike_steps = 0.02;  // relative difference of two missions' steps
constexpr std::size_t reach = 25;     // steps of the largest lag
constexpr std::size_t lags = 2 * reach + 1;
constexpr std::size_t block_rows = 100, most_blocks = 16;  // of a mission
constexpr std::size_t fewest_blocks = 3, most_groups = 64;
constexpr double least_explained = 0.1;  // of the variance, at the best lag
constexpr std::array<Eigen::Index, late_count> late_terms{6, 6, 5, 3, 3};
constexpr int draws = 100;

// Speeds of the right and left wheel, power of the motors, and the late channels.
constexpr std::size_t first_late = 3;
using Row = std::array<double, first_late + late_count>;

Row row_of(const signals::Sample& s) {
  const auto &w = s.wheel_velocity_rad_s, &v = s.motor_voltage_v, &i = s.motor_current_a;
  const double battery_w = s.battery_voltage_v * s.battery_current_a;
  return {w[0], w[1], v[0] * i[0] + v[1] * i[1], i[0], i[1], battery_w, s.yaw_rate_rad_s, battery_w};
}

// The readings, interpolated to a uniform grid; NaN in gaps.
std::vector<Row> on_grid(const telemetry::Recording& mission, double step_s) {
  std::vector<Row> grid;
  Row unknown;
  unknown.fill(signals::unmeasured);
  const signals::Sample* last = nullptr;
  for (const signals::Sample& sample : mission.samples) {
    if (!std::isfinite(sample.wheel_velocity_rad_s[0] + sample.wheel_velocity_rad_s[1])) continue;
    const auto place = [&](const signals::Sample& s) {
      return 1e-6 * static_cast<double>(s.utime_us - mission.samples.front().utime_us) / step_s;
    };
    const double to = place(sample), from = last != nullptr ? place(*last) : to;
    if (!(to > from) || to - from > longest_gap) {
      grid.push_back(unknown);  // one is enough: no lag reaches across it
      last = &sample;
      continue;
    }
    const Row a = row_of(*last), b = row_of(sample);
    for (double at = std::floor(from) + 1; at <= to; ++at) {
      Row& row = grid.emplace_back();
      for (std::size_t k = 0; k < row.size(); ++k) row[k] = a[k] + (at - from) / (to - from) * (b[k] - a[k]);
    }
    last = &sample;
  }
  return grid;
}

LagBlock empty(std::size_t late) {
  return {0, Eigen::MatrixXd::Zero(late_terms[late], late_terms[late]),
          Eigen::MatrixXd::Zero(late_terms[late], lags), Eigen::VectorXd::Zero(lags)};
}

// The terms of the motion and the motors' power for a late channel. `rows`: from the farthest lead to the
// farthest lag, the motion in their middle.
Eigen::VectorXd terms_of(std::span<const Row> rows, std::size_t late, std::size_t side, double step_s) {
  const Row& now = rows[reach];
  std::array<double, 2> slope;
  for (std::size_t k : {0u, 1u})
    slope[k] = (rows[reach + side][k] - rows[reach - side][k]) / (2 * static_cast<double>(side) * step_s);
  const double speed = now[0] + now[1], turn = now[0] - now[1];
  const auto way = [](double x) { return std::tanh(5 * x); };
  Eigen::VectorXd x(late_terms[late]);
  if (late < 2)
    x << way(now[late]), now[late], slope[late], slope[1 - late], way(now[late] - now[1 - late]), 1.0;
  else if (late == 2)
    x << std::fabs(speed), speed * speed, speed * (slope[0] + slope[1]), std::fabs(turn), 1.0;
  else if (late == 3)
    x << now[0], now[1], 1.0;
  else
    x << now[2], std::fabs(now[2]), 1.0;
  return x;
}

// Share of the channel's variance that the motion explains, at each lag.
Eigen::VectorXd explained(const LagBlock& sums) {
  const Eigen::Index last = sums.xx.rows() - 1;  // the constant
  const Eigen::VectorXd unit = sums.xx.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = unit.asDiagonal() * sums.xx * unit.asDiagonal();
  const Eigen::MatrixXd xy = unit.asDiagonal() * sums.xy;
  const Eigen::MatrixXd ridge = 1e-9 * Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols());
  const Eigen::MatrixXd b = (scaled + ridge).ldlt().solve(xy);
  Eigen::VectorXd part(sums.yy.size());
  for (Eigen::Index l = 0; l < part.size(); ++l) {
    const double mean = sums.xy(last, l) * sums.xy(last, l) / std::max(sums.rows, 1.0);
    const double total = sums.yy[l] - mean;
    part[l] = total > 0 ? (b.col(l).dot(xy.col(l)) - mean) / total : 0.0;
  }
  return part;
}

// The lag with the largest explained share, interpolated between steps by a parabola; NaN at the ends.
double best_lag(const Eigen::VectorXd& part) {
  Eigen::Index best = 0;
  part.maxCoeff(&best);
  if (best == 0 || best == part.size() - 1) return std::numeric_limits<double>::quiet_NaN();
  const double before = part[best - 1], at = part[best], after = part[best + 1];
  const double bend = before - 2 * at + after;
  return static_cast<double>(best - static_cast<Eigen::Index>(reach)) +
         (bend < 0 ? 0.5 * (before - after) / bend : 0.0);
}

constexpr double sharp = 0.5;  // interval over the delay, of a battery's behind the motors

// Smallest delay that is accepted as one: a row and a half, plus half of the time for which these readings or
// the wheel speeds are held.
double least_delay_s(const CheckContext& c, std::initializer_list<std::size_t> readings) {
  double held_s = std::max(c.held_s[0], c.held_s[1]);
  for (const std::size_t k : readings) held_s = std::max(held_s, c.held_s[k]);
  return 1.5 * c.period_s() + 0.5 * held_s;
}

void add_delay(Checks& checks, const char* id, const char* channel, const char* name, const Delay& delay,
               const char* against = "the wheel speeds") {
  const auto& [low, high] = delay.interval;
  add_check(checks, id, channel, {delay.value_s}, false,
            "{} {} {} by {:.0f} ms ({:.0f} to {:.0f}): joulecast expects the readings of one message to be "
            "of one instant.",
            name, delay.value_s > 0 ? "lag" : "lead", against, 1e3 * std::fabs(delay.value_s),
            1e3 * std::min(std::fabs(low), std::fabs(high)), 1e3 * std::max(std::fabs(low), std::fabs(high)))
      .interval = delay.interval;
}

}  // namespace

void LagBlock::join(const LagBlock& other, double weight) {
  rows += weight * other.rows;
  xx += weight * other.xx;
  xy += weight * other.xy;
  yy += weight * other.yy;
}

Lags::Lags(std::span<const telemetry::Recording> missions) {
  for (const telemetry::Recording& mission : missions) {
    const double step_s =  // 0: with fewer than two samples there is none
        mission.samples.size() < 2 ? 0 : std::max(finest_s, windows::median_period_s(mission));
    if (step_s_ == 0) step_s_ = step_s;
    if (step_s_ > 0 && std::fabs(step_s / step_s_ - 1) <= alike_steps) correlate(mission);
  }
}

void Lags::correlate(const telemetry::Recording& mission) {
  const std::vector<Row> grid = on_grid(mission, step_s_);
  if (grid.size() < lags) return;
  const auto steps = [&](double s) {
    return static_cast<std::size_t>(std::max(1.0, std::round(s / step_s_)));
  };
  const std::size_t side = steps(slope_s), near = steps(start_s), count = grid.size() - lags + 1;
  const std::size_t length = std::max(block_rows, (count + most_blocks - 1) / most_blocks);
  for (std::size_t begin = 0; begin < count; ++begin) {
    const std::span<const Row> rows(&grid[begin], lags);
    double slowest = std::numeric_limits<double>::infinity();
    for (std::size_t k = reach - near; k <= reach + near; ++k)
      slowest = std::min(slowest, std::fabs(rows[k][0]) + std::fabs(rows[k][1]));
    for (std::size_t late = 0; late < late_count; ++late) {
      if (begin % length == 0) blocks_[late].push_back(empty(late));
      if (late < static_cast<std::size_t>(Late::yaw_rate) && !(slowest > moving_rad_s)) continue;
      Eigen::VectorXd y(lags);
      for (std::size_t l = 0; l < lags; ++l) y[static_cast<Eigen::Index>(l)] = rows[l][first_late + late];
      if (!y.allFinite()) continue;
      const Eigen::VectorXd x = terms_of(rows, late, side, step_s_);
      if (!x.allFinite()) continue;
      LagBlock& block = blocks_[late].back();
      block.rows += 1;
      block.xx.noalias() += x * x.transpose();
      block.xy.noalias() += x * y.transpose();
      block.yy += y.cwiseAbs2();
    }
  }
  for (auto& blocks : blocks_) std::erase_if(blocks, [](const LagBlock& b) { return b.rows == 0; });
}

std::optional<Delay> Lags::delay(Late late) const {
  const auto k = static_cast<std::size_t>(late);
  const std::vector<LagBlock>& blocks = blocks_[k];
  if (blocks.size() < fewest_blocks) return std::nullopt;
  // Blocks are grouped: draws of some dozen groups scatter as much as draws of thousands of blocks.
  const std::size_t groups = std::min(blocks.size(), most_groups);
  std::vector<LagBlock> grouped(groups, empty(k));
  for (std::size_t n = 0; n < blocks.size(); ++n) grouped[n * groups / blocks.size()].join(blocks[n]);
  const auto part_of = [&](std::span<const int> weights) {
    LagBlock sums = empty(k);
    for (std::size_t n = 0; n < groups; ++n)
      if (weights[n] > 0) sums.join(grouped[n], weights[n]);
    return explained(sums);
  };
  const Eigen::VectorXd part = part_of(std::vector<int>(groups, 1));
  const double lag = best_lag(part);
  if (!std::isfinite(lag) || part.maxCoeff() < least_explained) return std::nullopt;
  const auto interval = statistics::bootstrap_interval(
      groups, [&](std::span<const int> w) { return step_s_ * best_lag(part_of(w)); }, draws);
  return Delay{step_s_ * lag, interval};
}

// That of one of the motor currents.
std::optional<Delay> delay_of_motors(const CheckContext& c) {
  const auto right = c.lags.delay(Late::current_right);
  return right ? right : c.lags.delay(Late::current_left);
}

std::optional<Delay> motor_delay(const CheckContext& c) {
  const auto delay = delay_of_motors(c);
  const double least = least_delay_s(c, {reading::motor_current, reading::motor_current + 1});
  return delay && delay->interval[0] > least ? delay : std::nullopt;
}

void check_delays(const CheckContext& c, Checks& checks) {
  using namespace reading;
  if (!c.heard({0, 1})) return;
  const auto late = c.heard({4, 5}) ? motor_delay(c) : std::nullopt;
  if (late) add_delay(checks, "electrical_delay", "motor_current", "The motor currents", *late);
  if (c.heard({battery_voltage, battery_current})) {
    const double least = least_delay_s(c, {battery_voltage, battery_current});
    const char* name = "Voltage and current of the battery";
    const auto behind = c.heard({2, 3, 4, 5}) ? c.lags.delay(Late::battery_by_motors) : std::nullopt;
    // If the motor currents lead, the shape of the load causes the apparent delay.
    const auto own = c.heard({4, 5}) ? delay_of_motors(c) : std::nullopt;
    const auto power = c.lags.delay(Late::battery_power);
    // Wrong currents differ in shape from the battery's power; every lag then fits a little. The interval
    // must be narrow.
    if (behind && behind->interval[1] - behind->interval[0] < sharp * std::fabs(behind->value_s) &&
        (behind->interval[0] > least || behind->interval[1] < -least)) {
      add_delay(checks, "electrical_delay", "battery_current", name, *behind, "the motors' power");
    } else if (!late && power && power->interval[0] > least && !(own && own->interval[1] < 0)) {
      add_delay(checks, "electrical_delay", "battery_current", name, *power);
    }
  }
  if (!c.heard({yaw_rate})) return;
  const double least = least_delay_s(c, {yaw_rate});
  if (const auto d = c.lags.delay(Late::yaw_rate); d && (d->interval[0] > least || d->interval[1] < -least))
    add_delay(checks, "yaw_rate_delay", "yaw_rate", "The gyro's readings", *d);
}

}  // namespace joulecast::plausibility
