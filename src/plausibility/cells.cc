#include "plausibility/cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "signals/gaps.h"

namespace joulecast::plausibility {
namespace {

constexpr double cell_s = 0.4;
constexpr double cell_rows = 4;
constexpr double longest_span_step_s = 5;  // between its rows
constexpr double moving_part = 0.02;       // of the fastest wheel speed
constexpr double resting_part = 0.005;
constexpr double span_s = 2.0;

double seconds(std::int64_t from_us, std::int64_t to_us) {
  return 1e-6 * static_cast<double>(to_us - from_us);
}

}  // namespace

void CellCutter::take(signals::Sample s) {
  const double t = seconds(begin_us_, s.utime_us);
  sums_.t += t;
  sums_.tt += t * t;
  for (std::size_t k : {0u, 1u}) sums_.tw[k] += t * s.wheel_velocity_rad_s[k];
  s.payload_kg = payload_.take(s.payload_kg);
  const auto readings = signals::numbers_of(s);
  for (std::size_t k = 0; k < motor_readings; ++k) {
    auto& [a, b] = sums_.last[k];
    if (sums_.rows() >= 2) sums_.alternating[k] = a - 2 * b + *readings[k] - sums_.alternating[k];
    a = std::exchange(b, *readings[k]);
  }
  for (std::size_t k = 0; k < reading_count; ++k) sums_.of[k].add(*readings[k]);
  sums_.battery_power.add(s.battery_voltage_v * s.battery_current_a);
  sums_.motor_power.add(s.motor_voltage_v[0] * s.motor_current_a[0] +
                        s.motor_voltage_v[1] * s.motor_current_a[1]);
}

Cell CellCutter::cell() const {
  using namespace reading;
  const auto mean = [](const ValueTally& t, double instead) { return t.known() > 0 ? t.mean() : instead; };
  Cell c;
  c.length_s = seconds(begin_us_, last_us_);
  for (std::size_t k = 0; k < reading_count; ++k)
    c.mean[k] = mean(sums_.of[k], k == payload ? 0 : std::numeric_limits<double>::quiet_NaN());
  c.resting = true;
  const double n = sums_.rows(), spread = n * sums_.tt - sums_.t * sums_.t,
               rest = resting_part * limit_rad_s_;
  // The rows count 1, 3, 4, ..., 4, 3 and 1 times, with alternating signs.
  for (std::size_t k = 0; k < motor_readings; ++k)
    c.noise[k] = sums_.alternating[k] / std::sqrt((16 * n - 44) * n);
  for (std::size_t k : {0u, 1u}) {
    const ValueTally& w = sums_.of[k];
    if (spread > 0) {
      c.acceleration_rad_s2[k] = n * (sums_.tw[k] - sums_.t * c.mean[k]) / spread;
      c.acceleration_noise[k] = c.noise[k] * n / std::sqrt(spread);
    }
    if (w.low() > moving_part * limit_rad_s_) c.way[k] = 1;
    if (w.high() < -moving_part * limit_rad_s_) c.way[k] = -1;
    c.resting = c.resting && std::fabs(c.mean[k]) < rest && std::max(w.high(), -w.low()) < 4 * rest;
  }
  // If voltage and current never occur in one row, the power is computed from their means.
  c.battery_power_w = mean(sums_.battery_power, c.mean[battery_voltage] * c.mean[battery_current]);
  c.motor_power_w = mean(sums_.motor_power, c.mean[motor_voltage] * c.mean[motor_current] +
                                                c.mean[motor_voltage + 1] * c.mean[motor_current + 1]);
  return c;
}

std::optional<Cell> CellCutter::add(const signals::Sample& sample) {
  std::optional<Cell> done;
  if (sums_.rows() > 0) {
    const double since = seconds(begin_us_, sample.utime_us), step = seconds(last_us_, sample.utime_us);
    const double usual = seconds(begin_us_, last_us_) / std::max(sums_.rows() - 1, 1.0);
    const bool gap = step < 0 || (sums_.rows() > 1 && step > signals::longest_bridged_s(usual));
    if (since >= cell_s && sums_.rows() >= cell_rows && !gap) done = cell();
    if (gap || done) sums_ = {};
  }
  if (sums_.rows() == 0) begin_us_ = sample.utime_us;
  last_us_ = sample.utime_us;
  take(sample);
  return done;
}

void SpanCutter::begin(const signals::Sample& sample) {
  first_ = last_ = sample;
  span_ = {};
  heading_sum_ = 0;
  rows_ = 1;
}

std::optional<Span> SpanCutter::add(const signals::Sample& sample) {
  const auto placed = [](const signals::Sample& s) { return std::isfinite(s.pose[0] + s.pose[1]); };
  if (!first_) return begin(sample), std::nullopt;
  const double step = seconds(last_->utime_us, sample.utime_us);
  if (!(step > 0) || step > longest_span_step_s) return begin(sample), std::nullopt;
  for (std::size_t k : {0u, 1u})
    span_.turned_rad[k] += 0.5 * step * (last_->wheel_velocity_rad_s[k] + sample.wheel_velocity_rad_s[k]);
  span_.gyro_rad += 0.5 * step * (last_->yaw_rate_rad_s + sample.yaw_rate_rad_s);
  const double turn = sample.pose[2] - last_->pose[2];
  span_.heading_rad += std::remainder(turn, 2 * std::numbers::pi);
  span_.heading_deg += std::remainder(turn, 360.0);
  heading_sum_ += span_.heading_rad;
  ++rows_;
  last_ = sample;
  span_.length_s = seconds(first_->utime_us, sample.utime_us);
  if (span_.length_s < span_s || (placed(*first_) != placed(sample))) {
    if (!placed(*first_) && placed(sample)) begin(sample);
    return std::nullopt;
  }
  const double dx = sample.pose[0] - first_->pose[0], dy = sample.pose[1] - first_->pose[1];
  const double heading = first_->pose[2] + heading_sum_ / static_cast<double>(rows_);
  span_.forward = dx * std::cos(heading) + dy * std::sin(heading);
  span_.distance = std::hypot(dx, dy);
  const auto mean = [](const signals::Sample& s) {
    return 0.5 * (s.wheel_velocity_rad_s[0] + s.wheel_velocity_rad_s[1]);
  };
  span_.begin_rad_s = mean(*first_);
  span_.end_rad_s = mean(sample);
  const Span done = span_;
  begin(sample);
  return done;
}

}  // namespace joulecast::plausibility
