#include "plausibility/delays.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "statistics/bootstrap.h"
#include "statistics/robust.h"

namespace joulecast::plausibility {
namespace {

constexpr std::size_t rows_for_step = 40;
constexpr double finest_s = 0.04;  // step; fine enough for delays of tens of ms
constexpr double longest_gap = 3;  // steps
constexpr double slope_s = 0.1;    // to each side, for accelerations
constexpr double start_s = 0.3;    // to each side without standstill; there currents build up before motion
constexpr double moving_rad_s = 0.4;  // sum of both wheels
constexpr std::size_t block_rows = 100;
constexpr std::size_t max_delay_blocks = 16;
constexpr std::size_t fewest_blocks = 3, most_groups = 64;
constexpr double least_explained = 0.1;  // of the variance, at the best lag
constexpr std::array<Eigen::Index, late_count> delay_terms{6, 6, 5, 3, 3};
constexpr int draws = 100;

LagBlock empty(std::size_t late) {
  const Eigen::Index lags = 2 * LagSums::reach() + 1;
  return {0, Eigen::MatrixXd::Zero(delay_terms[late], delay_terms[late]),
          Eigen::MatrixXd::Zero(delay_terms[late], lags), Eigen::VectorXd::Zero(lags)};
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
  return static_cast<double>(best - LagSums::reach()) + (bend < 0 ? 0.5 * (before - after) / bend : 0.0);
}

}  // namespace

void LagBlock::join(const LagBlock& other, double weight) {
  rows += weight * other.rows;
  xx += weight * other.xx;
  xy += weight * other.xy;
  yy += weight * other.yy;
}

LagSums::Row LagSums::row_of(const signals::Sample& s) {
  const double battery_w = s.battery_voltage_v * s.battery_current_a;
  return {s.wheel_velocity_rad_s,
          s.motor_voltage_v[0] * s.motor_current_a[0] + s.motor_voltage_v[1] * s.motor_current_a[1],
          {s.motor_current_a[0], s.motor_current_a[1], battery_w, s.yaw_rate_rad_s, battery_w}};
}

void LagSums::add(const signals::Sample& sample) {
  if (step_s_ > 0) return take(sample);
  first_.push_back(sample);
  if (first_.size() < rows_for_step) return;
  std::vector<double> steps;
  for (std::size_t k = 1; k < first_.size(); ++k) {
    steps.push_back(1e-6 * static_cast<double>(first_[k].utime_us - first_[k - 1].utime_us));
  }
  step_s_ = std::max(finest_s, statistics::median(std::move(steps)));
  begin_us_ = first_.front().utime_us;
  for (std::size_t k = 0; k < late_count; ++k) open_[k] = empty(k);
  const std::vector<signals::Sample> first = std::move(first_);
  first_.clear();
  for (const signals::Sample& s : first) take(s);
}

void LagSums::take(const signals::Sample& sample) {
  const auto place = [&](const signals::Sample& s) {
    return 1e-6 * static_cast<double>(s.utime_us - begin_us_) / step_s_;
  };
  const double to = place(sample), from = last_ ? place(*last_) : to;
  if (!(to > from) || to - from > longest_gap) {
    rows_.clear();
    next_ = static_cast<std::int64_t>(std::ceil(to));
    last_ = sample;
    return;
  }
  const Row a = row_of(*last_), b = row_of(sample);
  for (; static_cast<double>(next_) <= to; ++next_) {
    const double part = (static_cast<double>(next_) - from) / (to - from);
    Row row;
    for (std::size_t k : {0u, 1u}) row.speed[k] = a.speed[k] + part * (b.speed[k] - a.speed[k]);
    row.motor_power_w = a.motor_power_w + part * (b.motor_power_w - a.motor_power_w);
    for (std::size_t k = 0; k < late_count; ++k) row.late[k] = a.late[k] + part * (b.late[k] - a.late[k]);
    take(row);
  }
  last_ = sample;
}

void LagSums::take(const Row& row) {
  rows_.push_back(row);
  const auto width = static_cast<std::size_t>(2 * reach() + 1);
  if (rows_.size() < width) return;
  correlate();
  rows_.pop_front();
  if (++in_block_ < block_rows) return;
  in_block_ = 0;
  if (++waited_ == stride_) next_block();
}

bool LagSums::moving() const {
  const auto centre = static_cast<std::size_t>(reach());
  const auto near = static_cast<std::size_t>(std::max(1.0, std::round(start_s / step_s_)));
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = centre - near; k <= centre + near; ++k) {
    least = std::min(least, std::fabs(rows_[k].speed[0]) + std::fabs(rows_[k].speed[1]));
  }
  return least > moving_rad_s;
}

void LagSums::correlate() {
  const auto centre = static_cast<std::size_t>(reach());
  const auto side = static_cast<std::size_t>(std::max(1.0, std::round(slope_s / step_s_)));
  const std::array<double, 2>& w = rows_[centre].speed;
  std::array<double, 2> slope;
  for (std::size_t k : {0u, 1u}) {
    slope[k] = (rows_[centre + side].speed[k] - rows_[centre - side].speed[k]) /
               (2 * static_cast<double>(side) * step_s_);
  }
  const double speed = w[0] + w[1], turn = w[0] - w[1];
  const auto way = [](double x) { return std::tanh(5 * x); };
  const auto x_of = [&](std::size_t late) {
    Eigen::VectorXd x(delay_terms[late]);
    if (late < 2)
      x << way(w[late]), w[late], slope[late], slope[1 - late], way(w[late] - w[1 - late]), 1.0;
    else if (late == 2)
      x << std::fabs(speed), speed * speed, speed * (slope[0] + slope[1]), std::fabs(turn), 1.0;
    else if (late == 3)
      x << w[0], w[1], 1.0;
    else
      x << rows_[centre].motor_power_w, std::fabs(rows_[centre].motor_power_w), 1.0;
    return x;
  };
  const bool moves = moving();
  for (std::size_t late = 0; late < late_count; ++late) {
    if (late < static_cast<std::size_t>(Late::yaw_rate) && !moves) continue;
    Eigen::VectorXd y(2 * reach() + 1);
    for (Eigen::Index l = 0; l < y.size(); ++l) y[l] = rows_[static_cast<std::size_t>(l)].late[late];
    const Eigen::VectorXd x = x_of(late);
    if (!y.allFinite() || !x.allFinite()) continue;
    open_[late].rows += 1;
    open_[late].xx.noalias() += x * x.transpose();
    open_[late].xy.noalias() += x * y.transpose();
    open_[late].yy += y.cwiseAbs2();
  }
}

void LagSums::next_block() {
  waited_ = 0;
  for (std::size_t k = 0; k < late_count; ++k) {
    if (open_[k].rows == 0) continue;
    blocks_[k].push_back(std::exchange(open_[k], empty(k)));
  }
  if (std::ranges::none_of(blocks_, [](const auto& b) { return b.size() >= max_delay_blocks; })) return;
  for (auto& blocks : blocks_) halve(blocks);
  stride_ *= 2;
}

void LagSums::finish() {
  if (step_s_ > 0) next_block();
}

std::optional<Delay> delay_between(std::span<const LagSums* const> missions, std::span<const Late> channels) {
  // Missions with another sample rate than the first are on another grid and are skipped.
  double step = 0;
  std::vector<std::vector<const LagBlock*>> blocks(channels.size());
  for (const LagSums* mission : missions) {
    if (step == 0) step = mission->step_s();
    if (step == 0 || std::fabs(mission->step_s() / step - 1) > 0.02) continue;
    for (std::size_t k = 0; k < channels.size(); ++k)
      for (const LagBlock& block : mission->blocks(channels[k])) blocks[k].push_back(&block);
  }
  const std::size_t count = std::ranges::min(blocks, {}, &std::vector<const LagBlock*>::size).size();
  if (count < fewest_blocks) return std::nullopt;
  // Blocks are grouped: draws of some dozen groups scatter as much as draws of thousands of blocks.
  const std::size_t groups = std::min(count, most_groups);
  std::vector<std::vector<LagBlock>> grouped;
  for (std::size_t k = 0; k < channels.size(); ++k) {
    grouped.emplace_back(groups, empty(static_cast<std::size_t>(channels[k])));
    for (std::size_t n = 0; n < count; ++n) grouped[k][n * groups / count].join(*blocks[k][n]);
  }
  const auto parts = [&](std::span<const int> weights) {
    Eigen::VectorXd part = Eigen::VectorXd::Zero(2 * LagSums::reach() + 1);
    for (std::size_t k = 0; k < channels.size(); ++k) {
      LagBlock sums = empty(static_cast<std::size_t>(channels[k]));
      for (std::size_t n = 0; n < groups; ++n)
        if (weights[n] > 0) sums.join(grouped[k][n], weights[n]);
      part += explained(sums) / static_cast<double>(channels.size());
    }
    return part;
  };
  const std::vector<int> once(groups, 1);
  const Eigen::VectorXd part = parts(once);
  const double lag = best_lag(part);
  if (!std::isfinite(lag) || part.maxCoeff() < least_explained) return std::nullopt;
  const auto interval = statistics::bootstrap_interval(
      groups, [&](std::span<const int> w) { return step * best_lag(parts(w)); }, draws);
  return Delay{step * lag, interval};
}

}  // namespace joulecast::plausibility
