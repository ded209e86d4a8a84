#include "gap/posterior/data.h"

#include <algorithm>
#include <cmath>

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

// The motion at one sample.
Window instant_at(const windows::Track& c, std::size_t k, double period_s) {
  const double half_s = half_line_s(period_s);
  Window w;
  w.t_s = c.time_s[k];
  w.length_s = period_s;
  w.payload_kg = c.payload[k];
  for (const std::size_t s : {0u, 1u}) {
    windows::Line line = windows::line_at(c.time_s, c.speed[s], w.t_s, half_s);
    if (!std::isfinite(line.value)) line = {c.speed[s][k], 0};
    w.speed_rad_s[s] = line.value;
    w.acceleration_rad_s2[s] = line.slope;
    w.resting[s] = std::fabs(line.value) < windows::resting_rad_s;
    w.moving[s] = std::fabs(c.speed[s][k]) > windows::moving_rad_s;
  }
  for (std::size_t q = 0; q < c.motion.size(); ++q) w.recent_rad_s[q] = c.motion[q][k];
  w.x_m = c.x[k];
  w.y_m = c.y[k];
  w.heading_rad = c.heading[k];
  w.climb_rad = c.climb[k];
  for (const std::vector<double>& covariate : c.covariates) w.covariates.push_back(covariate[k]);
  return w;
}

void add_readings(const windows::Track& c, double period_s, double voltage_v, std::size_t mission,
                  double least_row_s, PowerRows& rows) {
  statistics::Updates fresh = statistics::find_updates(c.time_s, c.battery_current);
  std::vector<std::size_t>& at = fresh.at;
  std::erase_if(
      at, [&](std::size_t k) { return !std::isfinite(c.battery_power[k] + c.speed[0][k] + c.speed[1][k]); });
  const double length_s = fresh.held && least_row_s < fresh.period_s
                              ? 0
                              : std::max({row_s, row_readings * fresh.period_s, least_row_s});
  const auto row_of = [&](std::size_t n) {
    return length_s > 0 ? std::floor(c.time_s[at[n]] / length_s) : static_cast<double>(n);
  };
  double last_s = 0;
  for (std::size_t n = 0; n < at.size();) {
    std::size_t end = n;
    double sum = 0;
    for (; end < at.size() && row_of(end) == row_of(n); ++end) sum += c.battery_power[at[end]];
    const std::size_t count = end - n, instants = std::min(count, row_instants);
    for (std::size_t k = 0; k < instants; ++k) {
      rows.instants.push_back(instant_at(c, at[n + (2 * k + 1) * count / (2 * instants)], period_s));
      rows.instants.back().mission = mission;
      rows.instants.back().battery_voltage_v = voltage_v;
    }
    Window& row = rows.instants[rows.first.back()];
    row.continues = n > 0 && row.t_s - last_s < 2 * std::max(length_s, fresh.period_s);
    last_s = row.t_s;
    rows.first.push_back(rows.instants.size());
    rows.power_w.push_back(sum / static_cast<double>(count));
    n = end;
  }
}

// Rows between samples that are far apart: speeds change linearly from one to the next, and a sample's power
// is the mean over a period that begins `phase` of a period before it. 1 stands for a mean since the last
// sample, 0.5 for one about the sample.
void add_intervals(const windows::Track& c, double period_s, double voltage_v, std::size_t mission,
                   double least_row_s, double phase, PowerRows& rows) {
  const double length_s = std::max({row_s, row_readings * period_s, least_row_s});
  const auto known = [&](std::size_t k) {
    return std::isfinite(c.battery_power[k] + c.speed[0][k] + c.speed[1][k]);
  };
  double last = -2, energy_j = 0, known_s = 0;
  const auto finish = [&] {
    if (known_s > 0) rows.first.push_back(rows.instants.size()), rows.power_w.push_back(energy_j / known_s);
    energy_j = known_s = 0;
  };
  for (std::size_t k = 1; k < c.time_s.size(); ++k) {
    const double step_s = c.time_s[k] - c.time_s[k - 1];
    if (!known(k - 1) || !known(k) || step_s > 1.5 * period_s) continue;
    const double row = std::floor(c.time_s[k] / length_s);
    if (row != last) finish();
    Window& w = rows.instants.emplace_back(instant_at(c, k, period_s));
    w.continues = row == last + 1;
    w.t_s = c.time_s[k] - step_s / 2;
    w.length_s = step_s;
    w.mission = mission;
    w.battery_voltage_v = voltage_v;
    for (const std::size_t s : {0u, 1u}) {
      const double from = c.speed[s][k - 1], to = c.speed[s][k];
      w.speed_rad_s[s] = (from + to) / 2;
      w.acceleration_rad_s2[s] = (to - from) / step_s;
      w.resting[s] = std::max(std::fabs(from), std::fabs(to)) < windows::resting_rad_s;
      w.moving[s] = from * to > 0 && std::min(std::fabs(from), std::fabs(to)) > windows::moving_rad_s;
    }
    energy_j += step_s * (phase * c.battery_power[k] + (1 - phase) * c.battery_power[k - 1]);
    known_s += step_s;
    last = row;
  }
  finish();
}

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
void expect_accelerations(std::span<const windows::Track> tracks, PowerRows& rows) {
  std::vector<std::array<Half, 2>> halves;
  for (const windows::Track& c : tracks) halves.push_back({Half(c, 0), Half(c, 1)});
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
          const windows::Track& c = tracks[w.mission];
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
    const auto rows_by = [&](double phase) {
      PowerRows rows;
      for (std::size_t m = 0; m < missions.size(); ++m)
        add_intervals(tracks[m], period_s[m], voltage_v[m], m, least_row_s, phase, rows);
      return rows;
    };
    const auto left_by = [&](const PowerRows& rows) {
      return left_by_regression(rows, robot.kinematics.wheel_radius_m);
    };
    // Recorders of few rows state the power of an instant, or its mean since the last row.
    PowerRows means;
    if (readings.row_s > windows::far_apart_s && !readings.battery_held) means = rows_by(1);
    if (means.size() > 0 && left_by(means) < left_by(rows_by(0.5))) {
      d.rows = std::move(means);
    } else {
      for (std::size_t m = 0; m < missions.size(); ++m)
        add_readings(tracks[m], period_s[m], voltage_v[m], m, least_row_s, d.rows);
      expect_accelerations(tracks, d.rows);
    }
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
