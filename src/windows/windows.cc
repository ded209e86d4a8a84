#include "windows/windows.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "statistics/robust.h"
#include "statistics/updates.h"
#include "windows/track.h"

namespace joulecast::windows {
namespace {

constexpr std::size_t kept_together = 50;  // windows, where some are left out

// Mean of a column within +-half_s of an instant.
double mean_near(const Track& c, const std::vector<double>& v, double t, double half_s) {
  auto k = static_cast<std::size_t>(std::ranges::lower_bound(c.time_s, t - half_s - 1e-9) - c.time_s.begin());
  double sum = 0;
  std::size_t count = 0;
  for (; k < c.time_s.size() && c.time_s[k] <= t + half_s + 1e-9; ++k, ++count) sum += v[k];
  return count > 0 ? sum / static_cast<double>(count) : missing;
}

void add_span(const Track& c, const WindowSettings& settings, const robot::RobotModel& robot, Window& w) {
  const double from = w.t_s, to = w.t_s + settings.span_s, half = 0.1;
  if (to + half > c.time_s.back() || from - half < c.time_s.front()) return;
  const auto change = [&](const std::vector<double>& v) {
    return mean_near(c, v, to, half) - mean_near(c, v, from, half);
  };
  const double dx = change(c.x), dy = change(c.y), turn = change(c.heading);
  for (const std::size_t s : {0u, 1u}) w.span_angle_rad[s] = change(c.angle[s]);
  w.turn_rad = turn;
  if (!std::isfinite(dx + dy + turn)) return;
  double east = 0, north = 0, length = 0, previous = from;
  for (auto k = static_cast<std::size_t>(std::ranges::lower_bound(c.time_s, from) - c.time_s.begin());
       k < c.time_s.size() && c.time_s[k] <= to; ++k) {
    const double ds =
        robot.kinematics.wheel_radius_m * 0.5 * (c.speed[0][k] + c.speed[1][k]) * (c.time_s[k] - previous);
    previous = c.time_s[k];
    east += ds * std::cos(c.heading[k]);
    north += ds * std::sin(c.heading[k]);
    length += ds;
  }
  const double chord = std::hypot(east, north);
  if (std::fabs(length) < 0.05 || chord < 0.7 * std::fabs(length)) return;
  const double way = length > 0 ? 1.0 : -1.0;
  w.forward_m = way * (dx * east + dy * north) / chord;
  w.chord = chord / std::fabs(length);
}

// Rows [first, last) in a window about `centre_s`.
struct Place {
  std::size_t first, last;
  double centre_s, length_s;
};

// Sets what is a mean over the window's rows in every kind of window.
template <class Mean>
void set_means(const Track& c, Mean mean, Window& w) {
  for (const std::size_t s : {0u, 1u})
    for (std::size_t q = 0; q < c.heat.size(); ++q) w.copper_heat_w[q][s] = mean(c.heat[q][s]);
  for (std::size_t q = 0; q < c.motion.size(); ++q) w.recent_rad_s[q] = mean(c.motion[q]);
  w.battery_voltage_v = mean(c.battery_voltage);
  w.battery_current_a = mean(c.battery_current);
  w.battery_power_w = mean(c.battery_power);
  w.mission_voltage_v = c.mean_battery_voltage_v;
  w.charge_as = mean(c.charge);
  w.payload_kg = mean(c.payload);
  w.yaw_rate_rad_s = mean(c.yaw_rate);
  w.climb_rad = mean(c.climb);
  w.x_m = mean(c.x);
  w.y_m = mean(c.y);
  w.heading_rad = mean(c.heading);
  for (const std::vector<double>& covariate : c.covariates) w.covariates.push_back(mean(covariate));
}

Window window_at(const Track& c, const Place& at) {
  const Kernel kernel(c.time_s, at.first, at.last, at.centre_s, at.length_s);
  Window w;
  w.t_s = at.centre_s;
  w.length_s = at.length_s;
  w.part_weight = kernel.part_weight();
  set_means(
      c, [&](const std::vector<double>& v) { return kernel.mean(v); }, w);
  for (const std::size_t s : {0u, 1u}) {
    w.speed_rad_s[s] = kernel.mean(c.speed[s]);
    w.acceleration_rad_s2[s] = kernel.slope(c.speed[s]);
    for (std::size_t part = 0; part < w.part_weight.size(); ++part) {
      w.part_speed_rad_s[part][s] =
          w.part_weight[part] > 0 ? kernel.mean_of_part(part, c.speed[s]) : w.speed_rad_s[s];
      w.part_acceleration_rad_s2[part][s] = w.acceleration_rad_s2[s];
    }
    double slowest = std::numeric_limits<double>::infinity(), fastest = 0;
    bool forward = false, backward = false, slides = true;
    for (std::size_t k = at.first; k < at.last; ++k) {
      const double speed = c.smooth_speed[s][k];
      slides = slides && c.slid[s][k] >= sliding_rad;
      slowest = std::min(slowest, std::fabs(speed));
      fastest = std::max(fastest, std::fabs(speed));
      (speed > 0 ? forward : backward) = true;
    }
    w.moving[s] = slowest > moving_rad_s && !(forward && backward) && slides;
    w.resting[s] = fastest < resting_rad_s;
    w.current_a[s] = kernel.mean(c.current[s]);
    w.voltage_slope_v_s[s] = kernel.slope(c.voltage[s]);
    w.current_slope_a_s[s] = kernel.slope(c.current[s]);
    const double inductive_v = c.inductance_h * w.current_slope_a_s[s];
    w.voltage_v[s] = kernel.mean(c.voltage[s]) - (std::isfinite(inductive_v) ? inductive_v : 0);
    w.motor_power_w[s] = kernel.mean(c.power[s]);
    w.motor_power_abs_w[s] = kernel.mean(c.power_abs[s]);
    w.braking_w[s] = kernel.mean(c.braking[s]);
    // At rest the reading is noise about nothing.
    w.current_sign[s] = w.resting[s] ? 0.0 : kernel.mean(c.current_sign[s]);
  }
  w.battery_power_slope_w_s = kernel.slope(c.battery_power);
  return w;
}

void forget_battery(Window& w) {
  w.battery_voltage_v = w.battery_current_a = w.battery_power_w = missing;
  w.battery_power_slope_w_s = 0;
}

void forget_motors(Window& w) {
  w.voltage_v = w.current_a = w.motor_power_w = {missing, missing};
  w.voltage_slope_v_s = w.current_slope_a_s = {};
}

// Copies the battery's readings at a row into a window; single readings have no slope.
void read_battery(const Track& c, std::size_t row, Window& w) {
  w.battery_voltage_v = c.battery_voltage[row];
  w.battery_current_a = c.battery_current[row];
  w.battery_power_w = c.battery_power[row];
  w.battery_power_slope_w_s = 0;
}

void read_motors(const Track& c, std::size_t row, Window& w) {
  for (const std::size_t s : {0u, 1u}) {
    w.voltage_v[s] = c.voltage[s][row];
    w.current_a[s] = c.current[s][row];
    w.motor_power_w[s] = c.power[s][row];
    w.motor_power_abs_w[s] = c.power_abs[s][row];
    w.braking_w[s] = c.braking[s][row];
  }
  w.voltage_slope_v_s = w.current_slope_a_s = {};
}

double window_length_s(const WindowSettings& settings, double period_s) {
  return std::max(settings.length_s, static_cast<double>(settings.fewest_samples) * period_s);
}

class MissionWindows {
 public:
  MissionWindows(const telemetry::Recording& mission, std::size_t number, const robot::RobotModel& robot,
                 std::span<const std::string> covariates, const Readings& readings,
                 const WindowSettings& settings)
      : robot_(robot),
        readings_(readings),
        settings_(settings),
        number_(number),
        period_s_(median_period_s(mission)),
        longest_gap_s_(longest_gap_s(period_s_, settings)),
        track_(make_track(mission, robot, covariates, period_s_, settings)) {}

  // `position` counts windows over all missions, kept or not.
  void add_regular(std::vector<Window>& windows, std::size_t& position, std::size_t keep_every) const {
    const std::vector<double>& t = track_.time_s;
    const double length = window_length_s(settings_, period_s_);
    const double hop = 0.5 * length;
    const auto windows_a_span = static_cast<std::size_t>(std::max(1.0, std::round(settings_.span_s / hop)));
    if (t.back() < length) return;
    const auto count = static_cast<std::size_t>((t.back() - length) / hop) + 1;
    std::size_t first = 0;
    bool continues = false;
    for (std::size_t k = 0; k < count; ++k) {
      const double from = static_cast<double>(k) * hop;
      while (first < t.size() && t[first] < from) ++first;
      const bool kept = position++ / kept_together % keep_every == 0;
      Place at{first, first, from + 0.5 * length, length};
      if (!kept || !find_rows(at)) {
        continues = false;
        continue;
      }
      Window w = window_at(track_, at);
      if (readings_.battery_held) forget_battery(w);
      if (readings_.motors_held) forget_motors(w);
      if (k % windows_a_span == 0) add_span(track_, settings_, robot_, w);
      add(windows, w, continues);
      continues = true;
    }
  }

  void add_readings(std::vector<Window>& windows) const {
    const std::vector<double>& t = track_.time_s;
    const auto updates =
        statistics::find_updates(t, readings_.motors_held ? track_.current[0] : track_.battery_current);
    double last_s = -1e300;
    for (const std::size_t row : updates.at) {
      Place at{0, 0, t[row], std::max(settings_.length_s, fewest_rows * period_s_)};
      const double from = at.centre_s - 0.5 * at.length_s;
      if (from < t.front() || at.centre_s + 0.5 * at.length_s > t.back()) continue;
      at.first = static_cast<std::size_t>(std::ranges::lower_bound(t, from) - t.begin());
      if (!find_rows(at)) continue;
      Window w = window_at(track_, at);
      // Channels that are not held are averaged over the window; held ones have their value at this row.
      if (readings_.battery_held) read_battery(track_, row, w);
      if (readings_.motors_held) read_motors(track_, row, w);
      if (!readings_.battery_held) forget_battery(w);
      w.reading = true;
      w.motors_apart = !readings_.motors_held;
      // The regular windows contain the yaw rate.
      w.yaw_rate_rad_s = missing;
      add(windows, w, t[row] - last_s < 1.5 * readings_.period_s);
      last_s = t[row];
    }
  }

 private:
  // Rows within the window; whether there are enough, without a gap.
  bool find_rows(Place& at) const {
    const std::vector<double>& t = track_.time_s;
    const double from = at.centre_s - 0.5 * at.length_s, to = at.centre_s + 0.5 * at.length_s;
    if (at.first >= t.size()) return false;
    double gap = t[at.first] - from;
    at.last = at.first;
    while (at.last < t.size() && t[at.last] <= to + 1e-9) {
      if (at.last > at.first) gap = std::max(gap, t[at.last] - t[at.last - 1]);
      ++at.last;
    }
    if (at.last > at.first) gap = std::max(gap, to - t[at.last - 1]);
    // One row may come too late.
    const double fewest =
        std::min(0.5 * static_cast<double>(settings_.fewest_samples), at.length_s / period_s_ - 1);
    return static_cast<double>(at.last - at.first) >= std::max(3.0, std::floor(fewest)) &&
           gap <= longest_gap_s_;
  }

  void add(std::vector<Window>& windows, Window& w, bool continues) const {
    w.mission = number_;
    w.electrical_shift_s = settings_.electrical_delay_s;
    w.continues = continues;
    windows.push_back(std::move(w));
  }

  const robot::RobotModel& robot_;
  const Readings& readings_;
  const WindowSettings& settings_;
  std::size_t number_;
  double period_s_, longest_gap_s_;
  Track track_;
};

constexpr double read_often = 0.2;  // of the rows

// Rows over all missions, and how many have a reading.
struct Coverage {
  std::size_t rows = 0, currents = 0, voltages = 0, battery = 0;

  void add(const signals::Sample& s) {
    ++rows;
    currents += std::isfinite(s.motor_current_a[0] + s.motor_current_a[1]) ? 1 : 0;
    voltages += std::isfinite(s.motor_voltage_v[0] + s.motor_voltage_v[1]) ? 1 : 0;
    battery += std::isfinite(s.battery_voltage_v * s.battery_current_a) ? 1 : 0;
  }
  bool often(std::size_t count) const {
    return static_cast<double>(count) > read_often * static_cast<double>(rows);
  }
};

constexpr std::size_t enough_missions = 8;  // to leave out whole ones
constexpr std::size_t most_blocks = 20;
constexpr double shortest_block_s = 15;  // shorter blocks share slow errors with their neighbours

}  // namespace

std::vector<std::string> covariate_names(std::span<const telemetry::Recording> missions) {
  struct Values {
    double first = missing;
    bool differ = false;
  };
  std::map<std::string, Values> names;
  for (const telemetry::Recording& mission : missions) {
    for (const signals::CovariateSeries& series : mission.covariates) {
      if (series.name == signals::height_covariate) continue;
      Values& values = names[series.name];
      for (const double v : series.value) {
        if (!std::isfinite(v)) continue;
        if (!std::isfinite(values.first)) values.first = v;
        values.differ = values.differ || v != values.first;
      }
    }
  }
  std::vector<std::string> differing;
  for (const auto& [name, values] : names)
    if (values.differ) differing.push_back(name);
  return differing;
}

std::vector<Window> make_windows(std::span<const telemetry::Recording> missions,
                                 const robot::RobotModel& robot, const Readings& readings,
                                 const WindowSettings& settings) {
  double expected = 0;
  for (const telemetry::Recording& mission : missions)
    expected += 2 * telemetry::length_s(mission) / window_length_s(settings, median_period_s(mission));
  const auto keep_every = static_cast<std::size_t>(
      std::max(1.0, std::ceil(expected / static_cast<double>(settings.most_windows))));
  const std::vector<std::string> covariates = covariate_names(missions);
  std::vector<Window> windows;
  std::size_t position = 0;
  for (std::size_t m = 0; m < missions.size(); ++m) {
    const MissionWindows mission(missions[m], m, robot, covariates, readings, settings);
    mission.add_regular(windows, position, keep_every);
    if (readings.held()) mission.add_readings(windows);
  }
  return windows;
}

Readings find_readings(std::span<const telemetry::Recording> missions) {
  std::vector<double> rows, battery_periods, motor_periods;
  Coverage coverage;
  for (const telemetry::Recording& mission : missions) {
    rows.push_back(median_period_s(mission));
    std::vector<double> time_s, battery_a, motor_a;
    for (const signals::Sample& s : mission.samples) {
      time_s.push_back(1e-6 * static_cast<double>(s.utime_us - mission.samples.front().utime_us));
      battery_a.push_back(s.battery_current_a);
      motor_a.push_back(s.motor_current_a[0]);
      coverage.add(s);
    }
    const auto battery = statistics::find_updates(time_s, battery_a);
    const auto motors = statistics::find_updates(time_s, motor_a);
    if (battery.held) battery_periods.push_back(battery.period_s);
    if (motors.held) motor_periods.push_back(motors.period_s);
  }
  Readings readings;
  readings.row_s = statistics::median(std::move(rows));
  const auto held = [&](std::vector<double> periods) {
    if (2 * periods.size() <= missions.size()) return 0.0;
    const double period = statistics::median(std::move(periods));
    return period > 0.5 * WindowSettings{}.length_s ? period : 0.0;
  };
  const double battery_s = held(std::move(battery_periods)), motors_s = held(std::move(motor_periods));
  readings.battery_held = battery_s > 0;
  readings.motors_held = motors_s > 0;
  readings.period_s = std::max({battery_s, motors_s, readings.row_s});
  readings.motor_currents = coverage.often(coverage.currents);
  readings.motor_voltages = coverage.often(coverage.voltages);
  readings.battery_power = coverage.battery > 0;
  return readings;
}

std::size_t assign_blocks(std::span<Window> windows, std::span<const double> mission_length_s) {
  double total_s = 0;
  for (const double length : mission_length_s) total_s += length;
  const double block_s = std::max(shortest_block_s, total_s / static_cast<double>(most_blocks));
  // Each mission is divided into equal segments; missions shorter than a block are joined with the next.
  std::vector<std::size_t> parts(mission_length_s.size(), 1), first(mission_length_s.size(), 0);
  std::size_t blocks = 0;
  double open_s = 0;  // of the block that short missions share
  for (std::size_t m = 0; m < mission_length_s.size(); ++m) {
    if (mission_length_s.size() < enough_missions)
      parts[m] = std::max<std::size_t>(1, static_cast<std::size_t>(mission_length_s[m] / block_s));
    const bool joins = m > 0 && parts[m] == 1 && parts[m - 1] == 1 && open_s > 0 &&
                       open_s + 0.5 * mission_length_s[m] < block_s;
    if (!joins) {
      first[m] = blocks;
      blocks += parts[m];
      open_s = 0;
    } else {
      first[m] = blocks - 1;
    }
    open_s += mission_length_s[m];
  }
  for (Window& w : windows) {
    const auto n = parts[w.mission];
    const double place = w.t_s / std::max(mission_length_s[w.mission], 1e-9) * static_cast<double>(n);
    w.block = first[w.mission] + std::min(n - 1, static_cast<std::size_t>(std::max(0.0, place)));
  }
  return blocks;
}

bool steady(const Window& w) {
  return (w.moving[0] || w.resting[0]) && (w.moving[1] || w.resting[1]);
}

dynamics::Instant instant_of(const Window& w) {
  dynamics::Instant at;
  at.wheel_speed_rad_s = w.speed_rad_s;
  at.wheel_acceleration_rad_s2 = w.acceleration_rad_s2;
  at.payload_kg = w.payload_kg;
  at.x_m = w.x_m;
  at.y_m = w.y_m;
  at.heading_rad = w.heading_rad;
  at.climb_rad = w.climb_rad;
  return at;
}

std::array<double, 5> plain_terms(const Window& w, double wheel_radius_m) {
  std::array<double, 5> terms{1, 0, 0, 0, 0};
  const double climb = std::isfinite(w.climb_rad) ? std::sin(w.climb_rad) : 0;
  const auto add = [&](double weight, const std::array<double, 2>& wheels,
                       const std::array<double, 2>& rates) {
    const double speed = 0.5 * wheel_radius_m * (wheels[0] + wheels[1]);
    terms[1] += weight * std::fabs(speed);
    terms[2] += weight * std::fabs(wheel_radius_m * (wheels[0] - wheels[1]));
    terms[3] += weight * speed * 0.5 * wheel_radius_m * (rates[0] + rates[1]);
    terms[4] += weight * speed * climb;
  };
  if (!w.reading) {
    add(1, w.speed_rad_s, w.acceleration_rad_s2);
    return terms;
  }
  for (std::size_t part = 0; part < w.part_weight.size(); ++part)
    add(w.part_weight[part], w.part_speed_rad_s[part], w.part_acceleration_rad_s2[part]);
  return terms;
}

}  // namespace joulecast::windows
