#include <algorithm>
#include <cmath>

#include "statistics/regression.h"
#include "statistics/robust.h"
#include "statistics/updates.h"
#include "windows/track.h"
#include "windows/windows.h"

namespace joulecast::windows {
namespace {

// Another time of reading is believed where it lets the regression miss by this much less.
constexpr double clearly_less = 0.97;
constexpr std::size_t fewest_readings = 40;
constexpr std::size_t most_readings = 4000;  // a regression of more says nothing new

// Motion of one mission with its integrals, so that the mean over any stretch costs two look-ups.
class Motion {
 public:
  static constexpr std::size_t terms = 4;

  explicit Motion(const Track& track, double wheel_radius_m) : time_s_(track.time_s) {
    const std::size_t n = time_s_.size();
    std::vector<double> speed(n), turning(n);
    for (std::size_t k = 0; k < n; ++k) {
      speed[k] = 0.5 * wheel_radius_m * (track.smooth_speed[0][k] + track.smooth_speed[1][k]);
      turning[k] = wheel_radius_m * (track.smooth_speed[0][k] - track.smooth_speed[1][k]);
    }
    for (auto& sum : sums_) sum.assign(n, 0.0);
    for (std::size_t k = 1; k < n; ++k) {
      const double step = time_s_[k] - time_s_[k - 1];
      const auto mean = [&](const std::vector<double>& v) { return 0.5 * (std::fabs(v[k]) + std::fabs(v[k - 1])); };
      // v a dt is the change of v^2/2.
      const std::array<double, terms> add{step, mean(speed) * step, mean(turning) * step,
                                          0.5 * (speed[k] * speed[k] - speed[k - 1] * speed[k - 1])};
      for (std::size_t j = 0; j < terms; ++j) sums_[j][k] = sums_[j][k - 1] + add[j];
    }
  }

  // Means over [from, to]; false where the recording does not reach.
  bool mean(double from, double to, std::array<double, terms>& out) const {
    if (from < time_s_.front() || to > time_s_.back()) return false;
    for (std::size_t j = 0; j < terms; ++j) out[j] = (at(sums_[j], to) - at(sums_[j], from)) / (to - from);
    return true;
  }

 private:
  double at(const std::vector<double>& sum, double t) const {
    const auto above = std::ranges::upper_bound(time_s_, t);
    const auto k = std::min(static_cast<std::size_t>(above - time_s_.begin()), time_s_.size() - 1);
    const double part = (t - time_s_[k - 1]) / (time_s_[k] - time_s_[k - 1]);
    return sum[k - 1] + part * (sum[k] - sum[k - 1]);
  }
  const std::vector<double>& time_s_;
  std::array<std::vector<double>, terms> sums_;
};

// Readings of power and when they were taken, over all missions.
struct Taken {
  std::size_t mission;
  double time_s, power_w;
};

// How much of the readings the regression misses, mean absolute, if they are of this stretch of motion.
double missed(std::span<const Motion> motions, std::span<const Taken> readings, double delay_s, double averaged_s,
              double margin_s) {
  Eigen::MatrixXd x(static_cast<Eigen::Index>(readings.size()), static_cast<Eigen::Index>(Motion::terms));
  Eigen::VectorXd y(x.rows());
  std::vector<std::size_t> block;
  Eigen::Index rows = 0;
  std::array<double, Motion::terms> means{}, ends{};
  for (const Taken& r : readings) {
    const Motion& motion = motions[r.mission];
    // The same readings for every choice.
    if (!motion.mean(r.time_s - margin_s, r.time_s + margin_s, ends)) continue;
    motion.mean(r.time_s - delay_s - 0.5 * averaged_s, r.time_s - delay_s + 0.5 * averaged_s, means);
    for (std::size_t j = 0; j < means.size(); ++j) x(rows, static_cast<Eigen::Index>(j)) = means[j];
    y[rows++] = r.power_w;
    block.push_back(r.mission);
  }
  if (rows < static_cast<Eigen::Index>(fewest_readings)) return missing;
  x.conservativeResize(rows, Eigen::NoChange);
  y.conservativeResize(rows);
  const statistics::Regression fit = statistics::robust_regression(x, y, block);
  return (y - x * fit.coefficients).cwiseAbs().mean();
}

}  // namespace

Readings find_readings(std::span<const telemetry::Recording> missions, const robot::RobotModel& robot) {
  Readings readings;
  std::vector<double> rows, battery_periods, motor_periods;
  std::vector<Taken> taken;
  std::vector<Track> tracks;
  const WindowSettings plain;
  for (const telemetry::Recording& mission : missions) {
    rows.push_back(median_period_s(mission));
    tracks.push_back(make_track(mission, robot, {}, rows.back(), plain));
    const Track& track = tracks.back();
    const auto battery = statistics::find_updates(track.time_s, track.battery_current);
    const auto motors = statistics::find_updates(track.time_s, track.current[0]);
    if (battery.held) battery_periods.push_back(battery.period_s);
    if (motors.held) motor_periods.push_back(motors.period_s);
    for (const std::size_t k : battery.at) {
      if (std::isfinite(track.battery_power[k])) taken.push_back({tracks.size() - 1, track.time_s[k], track.battery_power[k]});
    }
  }
  readings.row_s = statistics::median(std::move(rows));
  // A repetition that a window averages out is none.
  const auto held = [&](std::vector<double> periods) {
    if (2 * periods.size() <= missions.size()) return 0.0;
    const double period = statistics::median(std::move(periods));
    return period > 0.5 * plain.length_s ? period : 0.0;
  };
  const double battery_s = held(std::move(battery_periods)), motors_s = held(std::move(motor_periods));
  readings.battery_held = battery_s > 0;
  readings.motors_held = motors_s > 0;
  readings.period_s = std::max({battery_s, motors_s, readings.row_s});
  readings.averaged_s = std::max(plain.length_s, 2 * readings.row_s);
  if (!readings.battery_held) return readings;

  const std::size_t stride = taken.size() / most_readings + 1;
  std::vector<Taken> some;
  for (std::size_t k = 0; k < taken.size(); k += stride) some.push_back(taken[k]);
  std::vector<Motion> motions;
  for (const Track& track : tracks) motions.emplace_back(track, robot.kinematics.wheel_radius_m);
  const double p = readings.period_s, margin_s = p + 0.5 * std::max(p, readings.averaged_s);
  double least = clearly_less * missed(motions, some, 0, readings.averaged_s, margin_s);
  for (const double averaged_s : {readings.averaged_s, p}) {
    for (const double periods : {0.0, -0.5, -0.25, 0.25, 0.5, 1.0}) {
      const double error = missed(motions, some, periods * p, averaged_s, margin_s);
      if (!(error < least)) continue;
      least = error;
      readings.delay_s = periods * p;
      readings.averaged_s = averaged_s;
    }
  }
  return readings;
}

}  // namespace joulecast::windows
