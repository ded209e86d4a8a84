#include "gap/posterior/data.h"

#include <algorithm>
#include <cmath>

#include "base/try.h"
#include "statistics/updates.h"
#include "windows/track.h"

namespace joulecast::gap::posterior {
namespace {

constexpr double few = 0.2;  // of the windows: a channel with fewer readings is not used

// Samples of a mission with known wheel speeds.
struct Speeds {
  std::vector<double> time_s;
  std::array<std::vector<double>, 2> speed;

  explicit Speeds(const windows::Track& c) {
    for (std::size_t k = 0; k < c.time_s.size(); ++k) {
      if (!std::isfinite(c.speed[0][k] + c.speed[1][k])) continue;
      time_s.push_back(c.time_s[k]);
      for (const std::size_t s : {0u, 1u}) speed[s].push_back(c.speed[s][k]);
    }
  }

  // By a line through the samples within +-half_s, or through the samples beside the instant.
  double at(std::size_t side, double at_s, double half_s) const {
    const std::vector<double>&t = time_s, &v = speed[side];
    if (const double mean = windows::line_at(t, v, at_s, half_s, 2).value; std::isfinite(mean)) return mean;
    const auto next = std::ranges::lower_bound(t, at_s) - t.begin();
    const auto k = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(next, 1, std::ssize(t) - 1));
    return std::lerp(v[k - 1], v[k], (at_s - t[k - 1]) / (t[k] - t[k - 1]));
  }
};

// What a reading of battery power is: the power at its instant, or the mean since the last reading.
enum class Reading { of_instant, since_last };

// Rows of one mission's battery power.
class MissionPower {
 public:
  MissionPower(const windows::Track& track, double period_s, double voltage_v, std::size_t mission)
      : c_(track),
        speeds_(track),
        piece_s_(std::max(shortest_piece_s, period_s)),
        voltage_v_(voltage_v),
        mission_(mission),
        fresh_(statistics::find_updates(c_.time_s, c_.battery_current)) {
    std::erase_if(fresh_.at, [&](std::size_t k) {
      return !std::isfinite(c_.battery_power[k] + c_.speed[0][k] + c_.speed[1][k]);
    });
    row_length_s_ = fresh_.held ? fresh_.period_s : std::max(row_s, row_readings * fresh_.period_s);
  }

  double expected_rows() const { return fresh_.at.empty() ? 0 : c_.time_s.back() / row_length_s_; }

  // `position` counts rows over all missions, kept or not.
  void add(Reading reading, std::size_t keep_every, std::size_t& position, PowerRows& rows) const {
    const std::vector<std::size_t>& at = fresh_.at;
    const auto row_of = [&](std::size_t n) {
      return fresh_.held ? static_cast<double>(n) : std::floor(c_.time_s[at[n]] / row_length_s_);
    };
    double last_s = -1e300;
    for (std::size_t n = 1; n < at.size();) {
      const bool kept = position++ / windows::kept_together % keep_every == 0;
      double energy_j = 0, known_s = 0;
      Span open{};
      const double row = row_of(n);
      const std::size_t first = rows.instants.size();
      for (; n < at.size() && row_of(n) == row; ++n) {
        const std::optional<Span> span = kept ? span_of(n, reading) : std::nullopt;
        if (!span) continue;
        if (span->from_s > open.to_s + 1e-9) add_motion(open, rows), open = *span;
        open.to_s = span->to_s;
        energy_j += span->length_s() * power_w(n, reading);
        known_s += span->length_s();
      }
      add_motion(open, rows);
      if (rows.instants.size() == first) continue;
      Window& begin = rows.instants[first];
      begin.continues = begin.t_s - last_s < 2 * row_length_s_;
      last_s = begin.t_s;
      rows.first.push_back(rows.instants.size());
      rows.power_w.push_back(energy_j / known_s);
    }
  }

 private:
  struct Span {
    double from_s = 0, to_s = 0;
    double length_s() const { return to_s - from_s; }
  };

  // The time that a reading stands for. An instant lasts a piece where the motion is known between readings;
  // where each sample has a reading, two instants stand for the time between them.
  std::optional<Span> span_of(std::size_t n, Reading reading) const {
    const double before_s = c_.time_s[fresh_.at[n - 1]], at_s = c_.time_s[fresh_.at[n]];
    if (fresh_.held && reading == Reading::of_instant) return Span{at_s - piece_s_ / 2, at_s + piece_s_ / 2};
    if (at_s - before_s > 1.5 * fresh_.period_s + 1e-9) return std::nullopt;
    return Span{before_s, at_s};
  }
  double power_w(std::size_t n, Reading reading) const {
    const double p = c_.battery_power[fresh_.at[n]];
    return fresh_.held || reading == Reading::since_last ? p : (p + c_.battery_power[fresh_.at[n - 1]]) / 2;
  }

  // Pieces of a span in which the speeds change linearly.
  void add_motion(const Span& span, PowerRows& rows) const {
    if (!(span.length_s() > 0)) return;
    const double count = std::max(1.0, std::round(span.length_s() / piece_s_));
    const double step_s = span.length_s() / count;
    const auto knot = [&](double n) {
      const double at_s = span.from_s + n * step_s, half_s = step_s / 2;
      return std::array{speeds_.at(0, at_s, half_s), speeds_.at(1, at_s, half_s)};
    };
    for (double n = 0; n < count; ++n) {
      const auto from = knot(n), to = knot(n + 1);
      Window& w = rows.instants.emplace_back();
      w.t_s = span.from_s + (n + 0.5) * step_s;
      w.length_s = step_s;
      w.mission = mission_;
      w.battery_voltage_v = voltage_v_;
      for (const std::size_t s : {0u, 1u}) {
        const double slowest = std::min(std::fabs(from[s]), std::fabs(to[s]));
        const double fastest = std::max(std::fabs(from[s]), std::fabs(to[s]));
        w.speed_rad_s[s] = (from[s] + to[s]) / 2;
        w.acceleration_rad_s2[s] = (to[s] - from[s]) / step_s;
        w.resting[s] = fastest < windows::resting_rad_s;
        w.moving[s] = from[s] * to[s] > 0 && slowest > windows::moving_rad_s;
      }
      add_state(w);
    }
  }

  // What the model needs besides the wheels' motion, of the sample at the window's middle or after it.
  void add_state(Window& w) const {
    const auto next = std::ranges::lower_bound(c_.time_s, w.t_s) - c_.time_s.begin();
    const auto k = static_cast<std::size_t>(std::min(next, std::ssize(c_.time_s) - 1));
    w.payload_kg = c_.payload[k];
    for (std::size_t q = 0; q < c_.motion.size(); ++q) w.recent_rad_s[q] = c_.motion[q][k];
    w.x_m = c_.x[k];
    w.y_m = c_.y[k];
    w.heading_rad = c_.heading[k];
    w.climb_rad = c_.climb[k];
    for (const std::vector<double>& covariate : c_.covariates) w.covariates.push_back(covariate[k]);
  }

  const windows::Track& c_;
  Speeds speeds_;
  double piece_s_, voltage_v_;
  std::size_t mission_;
  statistics::Updates fresh_;  // with known power and speeds
  double row_length_s_;
};

// Mean square of the power that a regression on the plain terms leaves [W^2].
double left_by_regression(const PowerRows& rows, double wheel_radius_m) {
  constexpr Eigen::Index count = std::tuple_size_v<decltype(windows::plain_terms({}, 0))>;
  Eigen::MatrixXd x(ix(rows.size()), count);
  for (Eigen::Index j = 0; j < count; ++j)
    x.col(j) = rows.mean([&](const Window& w) { return windows::plain_terms(w, wheel_radius_m)[ux(j)]; });
  const Eigen::VectorXd y = rows.measured_w();
  return (y - x * x.completeOrthogonalDecomposition().solve(y)).squaredNorm() /
         static_cast<double>(rows.size());
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

// Change of a speed per second over a span, between means of its length about its ends; by every `step`-th
// sample from `first` on. NaN where an end has no sample.
double change_of(const windows::Track& c, std::size_t side, double middle_s, double length_s,
                 std::size_t first, std::size_t step) {
  double change = 0, lasts_s = 0;
  for (const double end : {-1.0, 1.0}) {
    const double from_s = middle_s + (end - 1) * length_s / 2, to_s = from_s + length_s;
    auto k = static_cast<std::size_t>(std::ranges::lower_bound(c.time_s, from_s - 1e-9) - c.time_s.begin());
    k += (first + step - k % step) % step;
    double sum = 0, sum_s = 0, count = 0;
    for (; k < c.time_s.size() && c.time_s[k] <= to_s + 1e-9; k += step)
      if (std::isfinite(c.speed[side][k])) sum += c.speed[side][k], sum_s += c.time_s[k], ++count;
    if (count == 0) return windows::missing;
    change += end * sum / count;
    lasts_s += end * sum_s / count;
  }
  return change / lasts_s;
}

// Replaces the accelerations by those expected given the noise of the speeds. A change a over longer spans
// predicts that over the pieces by q a, q = sum a1 b2 / sum a a over the rows, each change times the speed: 1
// of one half of the samples, 2 of the other, a of the longer and b of the shortest spans. Noise that is
// independent from sample to sample is in the denominator alone. Of the spans, those that predict best,
// longer ones by `clear_gain`.
void expect_accelerations(std::span<const windows::Track> tracks, PowerRows& rows) {
  double most = 0;
  std::vector<std::array<double, 2>> best;
  for (const double longer : span_lengths) {
    std::vector<std::array<double, 2>> slope(rows.instants.size());
    double product = 0, square = 0;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      for (const std::size_t s : {0u, 1u}) {
        double whole = 0, first = 0, second = 0, speed = 0;
        for (std::size_t k = rows.first[r]; k < rows.first[r + 1]; ++k) {
          const Window& w = rows.instants[k];
          const auto change = [&](double times, std::size_t from, std::size_t step) {
            return change_of(tracks[w.mission], s, w.t_s, times * w.length_s, from, step);
          };
          slope[k][s] = longer == 1 ? w.acceleration_rad_s2[s] : change(longer, 0, 1);
          whole += slope[k][s];
          first += change(longer, 0, 2);
          second += change(1, 1, 2);
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
                       double electrical_delay_s) {
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
  const auto whole = [](const Window& w) { return w.reading || windows::steady(w); };
  if (static_cast<std::size_t>(std::ranges::count_if(d.windows, whole)) < fewest_windows)
    return fail(Fault::invalid, "", "too little known motion");
  const auto share = [&](const auto& known) {
    return static_cast<double>(std::ranges::count_if(d.windows, known)) /
           static_cast<double>(d.windows.size());
  };
  d.motors = share([](const Window& w) { return std::isfinite(w.current_a[0] + w.current_a[1]); }) > few;
  d.voltages = !d.motors &&
               share([](const Window& w) { return std::isfinite(w.voltage_v[0] + w.voltage_v[1]); }) > few;

  std::vector<double> length_s, voltage_v, period_s;
  std::vector<windows::Track> tracks;
  for (const telemetry::Recording& mission : missions) {
    length_s.push_back(telemetry::length_s(mission));
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
    double expected_rows = 0, least = std::numeric_limits<double>::infinity();
    std::vector<MissionPower> powers;
    for (std::size_t m = 0; m < missions.size(); ++m) {
      powers.emplace_back(tracks[m], period_s[m], voltage_v[m], m);
      expected_rows += powers.back().expected_rows();
    }
    const auto keep_every = static_cast<std::size_t>(
        std::max(1.0, std::ceil(expected_rows / static_cast<double>(most_power_rows))));
    for (const Reading reading : {Reading::of_instant, Reading::since_last}) {
      PowerRows rows;
      std::size_t position = 0;
      for (const MissionPower& power : powers) power.add(reading, keep_every, position, rows);
      const double left = left_by_regression(rows, robot.kinematics.wheel_radius_m);
      if (left < least) least = left, d.rows = std::move(rows);
    }
    expect_accelerations(tracks, d.rows);
    d.blocks = assign(d.rows.instants, length_s);
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
