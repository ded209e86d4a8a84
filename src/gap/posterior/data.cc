#include "gap/posterior/data.h"

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "base/try.h"
#include "statistics/updates.h"
#include "windows/track.h"

namespace joulecast::gap::posterior {
namespace {

constexpr double few = 0.2;  // of the windows: a channel with fewer readings is not used

// Half of the line about a reading.
double half_line_s(double period_s) {
  return std::max(line_s, line_rows * period_s);
}

// Readings of a mission's battery power, rows with a new reading, in groups that become rows of power. Each
// states the time about itself, half of that to its neighbours.
class Meterings {
 public:
  Meterings(const windows::Track& track, double least_row_s) {
    const statistics::Updates fresh = statistics::find_updates(track.time_s, track.battery_current);
    period_s_ = fresh.period_s;
    for (const std::size_t k : fresh.at) {
      if (!std::isfinite(track.battery_power[k] + track.speed[0][k] + track.speed[1][k])) continue;
      at_.push_back(k);
      time_s_.push_back(track.time_s[k]);
      power_w_.push_back(track.battery_power[k]);
    }
    const bool single = fresh.held && least_row_s < period_s_;
    const double length_s = std::max({row_s, row_readings * period_s_, least_row_s});
    for (std::size_t n = 0; n < at_.size(); ++n)
      if (single || !follows(n) || std::floor(time_s_[n] / length_s) != std::floor(time_s_[n - 1] / length_s))
        first_.push_back(n);
    first_.push_back(at_.size());
  }

  std::size_t groups() const { return first_.size() - 1; }
  // Rows of a group's readings.
  std::span<const std::size_t> rows_of(std::size_t group) const {
    return std::span(at_).subspan(first_[group], first_[group + 1] - first_[group]);
  }
  double begin_s(std::size_t group) const { return begin_of(first_[group]); }
  double end_s(std::size_t group) const { return end_of(first_[group + 1] - 1); }
  double mean_power_w(std::size_t group) const {
    double energy_j = 0;
    for (std::size_t n = first_[group]; n < first_[group + 1]; ++n)
      energy_j += power_w_[n] * (end_of(n) - begin_of(n));
    return energy_j / (end_s(group) - begin_s(group));
  }

 private:
  bool follows(std::size_t n) const {
    return n > 0 && n < at_.size() && time_s_[n] - time_s_[n - 1] <= windows::longest_gap_s(period_s_);
  }
  double begin_of(std::size_t n) const {
    return follows(n) ? std::midpoint(time_s_[n - 1], time_s_[n]) : time_s_[n] - period_s_ / 2;
  }
  double end_of(std::size_t n) const {
    return follows(n + 1) ? std::midpoint(time_s_[n], time_s_[n + 1]) : time_s_[n] + period_s_ / 2;
  }

  std::vector<std::size_t> at_, first_;  // first reading of each group, and the end
  std::vector<double> time_s_, power_w_;
  double period_s_ = 0;
};

// Means of the speeds over `knot_s`, or one sample where they are farther apart; before the first and after
// the last the speeds are those there.
struct Knots {
  std::vector<double> time_s;
  std::array<std::vector<double>, 2> speed;

  Knots(const windows::Track& track, double period_s) {
    const auto samples = static_cast<std::size_t>(std::max(1.0, std::round(knot_s / period_s)));
    add(std::numeric_limits<double>::lowest(), {0, 0});
    for (std::size_t k = 0; k < track.time_s.size(); k += samples) {
      std::array<double, 3> sum{};
      double count = 0;
      for (std::size_t n = k; n < std::min(k + samples, track.time_s.size()); ++n) {
        const std::array sample{track.time_s[n], track.speed[0][n], track.speed[1][n]};
        if (!std::isfinite(sample[1] + sample[2])) continue;
        for (std::size_t q = 0; q < sum.size(); ++q) sum[q] += sample[q];
        ++count;
      }
      if (count > 0) add(sum[0] / count, {sum[1] / count, sum[2] / count});
    }
    add(std::numeric_limits<double>::max(), {speed[0].back(), speed[1].back()});
    for (std::vector<double>& v : speed) v.front() = v[1];
  }

 private:
  void add(double t_s, std::array<double, 2> speed_rad_s) {
    time_s.push_back(t_s);
    for (const std::size_t s : {0u, 1u}) speed[s].push_back(speed_rad_s[s]);
  }
};

// One mission without motor channels.
struct Metered {
  windows::Track track;
  double period_s, voltage_v;
  std::size_t mission;
  Meterings readings;
  Knots knots;
};

// What a sample states besides the speeds.
Window place_at(const Metered& m, std::size_t k) {
  const windows::Track& c = m.track;
  Window w;
  w.mission = m.mission;
  w.battery_voltage_v = m.voltage_v;
  w.payload_kg = c.payload[k];
  for (std::size_t q = 0; q < c.motion.size(); ++q) w.recent_rad_s[q] = c.motion[q][k];
  w.x_m = c.x[k];
  w.y_m = c.y[k];
  w.heading_rad = c.heading[k];
  w.climb_rad = c.climb[k];
  for (const std::vector<double>& covariate : c.covariates) w.covariates.push_back(covariate[k]);
  return w;
}

// Adds the motion of a group by straight lines through the speeds about some of its readings.
void add_lines(const Metered& m, std::size_t group, double delay_s, PowerRows& rows) {
  const windows::Track& c = m.track;
  const double half_s = half_line_s(m.period_s);
  const std::span<const std::size_t> read = m.readings.rows_of(group);
  const std::size_t instants = std::min(read.size(), row_instants);
  for (std::size_t n = 0; n < instants; ++n) {
    const std::size_t k = read[(2 * n + 1) * read.size() / (2 * instants)];
    Window& w = rows.instants.emplace_back(place_at(m, k));
    w.t_s = c.time_s[k] - delay_s;
    w.length_s = m.period_s;
    for (const std::size_t s : {0u, 1u}) {
      windows::Line line = windows::line_at(c.time_s, c.speed[s], w.t_s, half_s);
      if (!std::isfinite(line.value)) line = {c.speed[s][k], 0};
      w.speed_rad_s[s] = line.value;
      w.acceleration_rad_s2[s] = line.slope;
      w.resting[s] = std::fabs(line.value) < windows::resting_rad_s;
      w.moving[s] = std::fabs(c.speed[s][k]) > windows::moving_rad_s;
    }
  }
}

// Adds the motion of a group by pieces between knots, in which the speeds change linearly: its kinetic energy
// is exact.
void add_pieces(const Metered& m, std::size_t group, double delay_s, PowerRows& rows) {
  const Knots& knots = m.knots;
  const double from_s = m.readings.begin_s(group) - delay_s, to_s = m.readings.end_s(group) - delay_s;
  auto k =
      static_cast<std::size_t>(std::ranges::upper_bound(knots.time_s, from_s) - knots.time_s.begin()) - 1;
  for (; knots.time_s[k] < to_s; ++k) {
    const double whole_s = knots.time_s[k + 1] - knots.time_s[k];
    const double a = std::max(from_s, knots.time_s[k]), b = std::min(to_s, knots.time_s[k + 1]);
    const auto after = std::ranges::lower_bound(m.track.time_s, (a + b) / 2) - m.track.time_s.begin();
    const auto last = static_cast<std::ptrdiff_t>(m.track.time_s.size()) - 1;
    Window& w = rows.instants.emplace_back(place_at(m, static_cast<std::size_t>(std::min(after, last))));
    w.t_s = (a + b) / 2;
    w.length_s = b - a;
    for (const std::size_t s : {0u, 1u}) {
      const std::vector<double>& v = knots.speed[s];
      const double slope = (v[k + 1] - v[k]) / whole_s;
      const double from = v[k + 1] - (knots.time_s[k + 1] - a) * slope, to = from + (b - a) * slope;
      w.speed_rad_s[s] = (from + to) / 2;
      w.acceleration_rad_s2[s] = slope;
      w.resting[s] = std::max(std::fabs(from), std::fabs(to)) < windows::resting_rad_s;
      w.moving[s] = from * to > 0 && std::min(std::fabs(from), std::fabs(to)) > windows::moving_rad_s;
    }
  }
}

// A row for each group of all missions, with their power `delay_s` late.
template <class AddMotion>
PowerRows make_rows(std::span<const Metered> metered, double delay_s, const AddMotion& add_motion) {
  PowerRows rows;
  for (const Metered& m : metered) {
    for (std::size_t group = 0; group < m.readings.groups(); ++group) {
      add_motion(m, group, delay_s, rows);
      rows.instants[rows.first.back()].continues =
          group > 0 && m.readings.begin_s(group) == m.readings.end_s(group - 1);
      rows.first.push_back(rows.instants.size());
      rows.power_w.push_back(m.readings.mean_power_w(group));
    }
  }
  return rows;
}

// Terms of the power of two motors by their speeds w and accelerations a: w T + R i^2 with a torque T, and a
// current i that is proportional to it, of friction on each side, scrub, mass and yaw inertia.
using MotionTerms = std::array<double, 12>;
MotionTerms motion_terms(const Window& w) {
  const auto& [w0, w1] = w.speed_rad_s;
  const auto& [a0, a1] = w.acceleration_rad_s2;
  const double s0 = std::tanh(w0 / windows::moving_rad_s), s1 = std::tanh(w1 / windows::moving_rad_s);
  const double climb = std::isfinite(w.climb_rad) ? std::sin(w.climb_rad) : 0;
  return {1,
          w0 * s0,
          w1 * s1,
          w0 * w0 + w1 * w1,
          std::fabs(w0 - w1),
          w0 * a0 + w1 * a1,
          w0 * a1 + w1 * a0,
          a0 * a0 + a1 * a1,
          a0 * a1,
          s0 * a0 + s1 * a1,
          s0 * a1 + s1 * a0,
          (w0 + w1) * climb};
}

// Squares of the power that a regression on these terms leaves [W^2], of each row.
Eigen::ArrayXd left_by_regression(const PowerRows& rows) {
  std::vector<MotionTerms> terms(rows.instants.size());
  std::ranges::transform(rows.instants, terms.begin(), motion_terms);
  Eigen::MatrixXd x(ix(rows.size()), std::tuple_size_v<MotionTerms>);
  for (Eigen::Index j = 0; j < x.cols(); ++j)
    x.col(j) = rows.mean([&](const Window& w) { return terms[ux(&w - rows.instants.data())][ux(j)]; });
  const Eigen::VectorXd y = rows.measured_w();
  return (y - x * x.completeOrthogonalDecomposition().solve(y)).array().square();
}

// Segments of missions, equally long in each; many short missions share blocks. Returns their number.
std::size_t assign(std::span<Window> windows, std::span<const double> length_s) {
  double total = 0;
  for (const double s : length_s) total += s;
  std::vector<std::size_t> parts, first;
  std::size_t blocks = 0;
  double covered = 0;
  for (const double s : length_s) {
    if (length_s.size() > most_blocks) {
      parts.push_back(1);
      first.push_back(
          static_cast<std::size_t>(covered / (total * (1 + 1e-12)) * static_cast<double>(most_blocks)));
      covered += s;
      blocks = std::max(blocks, first.back() + 1);
      continue;
    }
    const double most = std::max(1.0, std::floor(s / shortest_block_s));
    parts.push_back(static_cast<std::size_t>(std::clamp(std::round(s / total * block_count), 1.0, most)));
    first.push_back(blocks);
    blocks += parts.back();
  }
  for (Window& w : windows) {
    const std::size_t n = parts[w.mission];
    const double place = w.t_s / (length_s[w.mission] + 1e-9) * static_cast<double>(n);
    w.block = first[w.mission] + std::min(n - 1, static_cast<std::size_t>(std::max(0.0, place)));
  }
  return blocks;
}

// Every other sample of a mission's wheel speeds, from the first or the second on.
struct Half {
  std::vector<double> time_s;
  std::array<std::vector<double>, 2> speed;

  Half(const windows::Track& c, std::size_t first) {
    for (std::size_t k = first; k < c.time_s.size(); k += 2) {
      time_s.push_back(c.time_s[k]);
      for (const std::size_t s : {0u, 1u}) speed[s].push_back(c.speed[s][k]);
    }
  }
};

// Replaces the accelerations by those expected given the noise of the speeds. A slope a of longer lines
// predicts that of the shortest lines by q a, q = sum a1 b2 / sum a a over the rows, each slope times the
// speed: 1 of one half of the samples, 2 of the other, a of the longer and b of the shortest lines. Noise
// that is independent from sample to sample is in the denominator alone. Of the lengths, the one that
// predicts best, a longer one by `clear_gain`.
void expect_accelerations(std::span<const Metered> metered, PowerRows& rows) {
  std::vector<std::array<Half, 2>> halves;
  for (const Metered& m : metered) halves.push_back({Half(m.track, 0), Half(m.track, 1)});
  double most = 0;
  std::vector<std::array<double, 2>> best;
  for (const double longer : line_lengths) {
    std::vector<std::array<double, 2>> slope(rows.instants.size());
    double product = 0, square = 0;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      for (const std::size_t s : {0u, 1u}) {
        double whole = 0, first = 0, second = 0, speed = 0;
        for (std::size_t k = rows.first[r]; k < rows.first[r + 1]; ++k) {
          const Window& w = rows.instants[k];
          const windows::Track& c = metered[w.mission].track;
          const auto& [one, two] = halves[w.mission];
          const double half_s = half_line_s(w.length_s);
          slope[k][s] = windows::line_at(c.time_s, c.speed[s], w.t_s, longer * half_s).slope;
          whole += slope[k][s];
          first += windows::line_at(one.time_s, one.speed[s], w.t_s, longer * half_s, 2).slope;
          second += windows::line_at(two.time_s, two.speed[s], w.t_s, half_s, 2).slope;
          speed += w.speed_rad_s[s];
        }
        if (!std::isfinite(speed * whole * first * second)) continue;
        product += speed * speed * first * second;
        square += speed * speed * whole * whole;
      }
    }
    if (!(product > 0) || product * product / square <= (1 + clear_gain) * most) continue;
    most = product * product / square;
    for (auto& of : slope)
      for (double& a : of) a *= product / square;
    best = std::move(slope);
  }
  for (std::size_t k = 0; k < best.size(); ++k)
    for (const std::size_t s : {0u, 1u})
      if (std::isfinite(best[k][s])) rows.instants[k].acceleration_rad_s2[s] = best[k][s];
}

// Rows of battery power. Recorders state the power of an instant or its mean since the last row, and read
// power and speeds at different times. A regression finds the delay of the power, at most `reach_s`, and
// whether pieces are better than lines, which need less precise speeds. Lines without a delay are used where
// nothing is surely better.
PowerRows power_rows(std::span<const Metered> metered, double reach_s) {
  const auto lines = [&](double delay_s) {
    PowerRows rows = make_rows(metered, delay_s, add_lines);
    expect_accelerations(metered, rows);
    return rows;
  };
  PowerRows rows = lines(0);
  if (rows.size() < fewest_rows || reach_s == 0) return rows;
  const auto left_at = [&](double delay_s) {
    return left_by_regression(make_rows(metered, delay_s, add_pieces)).mean();
  };
  double delay_s = 0, least = std::numeric_limits<double>::infinity();
  for (const double part : {-1.0, -0.5, 0.0, 0.5, 1.0})
    if (const double left = left_at(part * reach_s); left < least) least = left, delay_s = part * reach_s;
  std::uintmax_t steps = 8;
  delay_s =
      boost::math::tools::brent_find_minima(left_at, delay_s - reach_s / 2, delay_s + reach_s / 2, 10, steps)
          .first;
  const Eigen::ArrayXd before = left_by_regression(rows);
  double most = 0;
  for (PowerRows other : {lines(delay_s), make_rows(metered, delay_s, add_pieces)}) {
    const Eigen::ArrayXd gain = before - left_by_regression(other);
    const double sd = std::sqrt((gain - gain.mean()).square().sum()) / static_cast<double>(gain.size());
    if (gain.mean() > std::max(most, surely_better * sd)) most = gain.mean(), rows = std::move(other);
  }
  return rows;
}

// Windows with a measured power, as rows of one instant: the battery's, or where no window has one, that of
// the motors.
PowerRows rows_of(std::span<const Window> windows, const robot::RobotModel& robot) {
  const bool volts = voltages_read(windows);
  const bool battery =
      std::ranges::any_of(windows, [](const Window& w) { return std::isfinite(w.battery_power_w); });
  PowerRows rows;
  const std::size_t stride = windows.size() / most_windows + 1;
  for (std::size_t k = 0; k < windows.size(); k += stride) {
    const double power_w = battery ? windows[k].battery_power_w : motors_power(windows[k], robot, volts);
    if (!std::isfinite(power_w)) continue;
    rows.instants.push_back(windows[k]);
    rows.power_w.push_back(power_w);
    rows.first.push_back(rows.instants.size());
  }
  if (!battery) rows.meter.assign(rows.size(), Meter::motors);
  return rows;
}

}  // namespace

Result<Data> make_data(std::span<const telemetry::Recording> missions, const robot::RobotModel& robot,
                       double electrical_delay_s, bool as_read) {
  Data d;
  d.robot = robot;
  TRY_ASSIGN(d.in_file, dynamics::active_effects(robot));
  d.missions = missions.size();
  d.covariates = windows::covariate_names(missions);
  const windows::Readings readings = windows::find_readings(missions);
  d.sample_s = readings.row_s;
  const auto windows_by = [&](std::optional<std::size_t> half) {
    auto made = windows::make_windows(
        missions, robot, readings,
        {.electrical_delay_s = electrical_delay_s, .most_windows = most_windows, .half = half});
    std::erase_if(made, [](const Window& w) { return !std::isfinite(w.speed_rad_s[0] + w.speed_rad_s[1]); });
    return made;
  };
  d.windows = windows_by({});
  d.halves = {windows_by(0), windows_by(1)};
  const auto share = [&](const auto& known) {
    return static_cast<double>(std::ranges::count_if(d.windows, known)) /
           static_cast<double>(d.windows.size());
  };
  d.motors = share([](const Window& w) { return std::isfinite(w.current_a[0] + w.current_a[1]); }) > few;
  d.voltages = !d.motors &&
               share([](const Window& w) { return std::isfinite(w.voltage_v[0] + w.voltage_v[1]); }) > few;

  std::vector<double> length_s, voltage_v, period_s;
  std::vector<windows::Track> tracks;
  double total_s = 0;
  for (const telemetry::Recording& mission : missions) {
    length_s.push_back(telemetry::length_s(mission));
    total_s += length_s.back();
    period_s.push_back(windows::median_period_s(mission));
    tracks.push_back(windows::make_track(mission, robot, d.covariates, period_s.back(), {}));
    const double mean_v = tracks.back().mean_battery_voltage_v;
    voltage_v.push_back(std::isfinite(mean_v) ? mean_v : robot.battery.nominal_voltage_v);
  }
  for (const Window& w : d.windows) d.battery_voltage_v.push_back(w.battery_voltage_v);
  for (std::vector<Window>* windows : {&d.windows, &d.halves[0], &d.halves[1]})
    for (Window& w : *windows) w.battery_voltage_v = voltage_v[w.mission];
  d.blocks = assign(d.windows, length_s);
  if (d.motors) {
    d.rows = rows_of(d.windows, robot);
  } else {
    const double least_row_s = total_s / static_cast<double>(most_power_rows);
    std::vector<Metered> metered;
    for (std::size_t m = 0; m < missions.size(); ++m) {
      Meterings read(tracks[m], least_row_s);
      Knots knots(tracks[m], period_s[m]);
      metered.push_back(
          {std::move(tracks[m]), period_s[m], voltage_v[m], m, std::move(read), std::move(knots)});
    }
    d.rows = power_rows(metered, as_read ? 0 : std::max(readings.period_s, knot_s));
    d.blocks = assign(d.rows.instants, length_s);
  }
  if (d.motors || d.rows.size() < fewest_windows) {
    const auto steady = std::ranges::count_if(d.windows, windows::steady);
    if (static_cast<std::size_t>(steady) < fewest_windows)
      return fail(Fault::invalid, "", "too little known motion");
  }
  d.power = d.rows.size() >= fewest_rows;
  if (!d.power) d.rows = {};
  const dynamics::DriveModel model(robot, d.in_file);
  double sum = 0;
  for (const double p : d.rows.power_w) sum += std::fabs(p);
  for (const Window& w : d.windows)
    if (!d.power) sum += std::fabs(metered_powers(model, w).battery_w);
  const std::size_t count = d.power ? d.rows.size() : d.windows.size();
  d.mean_power_w = std::max(sum / static_cast<double>(count), 1e-3);
  return d;
}

Data rows_of_witness(const Data& data, Witness witness, const Eigen::VectorXd& factors) {
  Data d = data;
  d.witness = witness;
  std::ranges::copy(factors, d.factor_prior.begin());
  d.power = false;
  d.rows = {};
  d.voltages = false;
  return d;
}

Eigen::VectorXd predicted_power(const Data& data, std::span<const dynamics::ActiveEffect> effects) {
  const dynamics::DriveModel model(data.robot, effects);
  return data.rows.mean([&](const Window& w, Meter meter) { return metered_by(meter, model, w); });
}

}  // namespace joulecast::gap::posterior
