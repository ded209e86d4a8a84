#include "tests/study/trial/motion/motion_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/median.h"
#include "robot/robot_file.h"
#include "tests/study/trial/motion/judged.h"

namespace joulecast::trial::motion {
namespace {

using signals::Sample;
using telemetry::Recording;

constexpr double half_window_s = 0.4;
constexpr std::size_t fewest_neighbours = 2;  // on each side
constexpr double longest_gap_s = 1.0;         // between neighbours of one straight line

bool measured(const Sample& s) {
  return std::isfinite(s.battery_voltage_v) && std::isfinite(s.battery_current_a);
}

double seconds(std::int64_t from_us, std::int64_t to_us) {
  return 1e-6 * static_cast<double>(to_us - from_us);
}

// Value and slope at sample k of a straight line through the wheel speeds about it.
struct Line {
  std::array<double, 2> value{}, slope{};
};

Line line_at(const std::vector<Sample>& samples, std::size_t k) {
  const auto t = [&](std::size_t n) { return seconds(samples[k].utime_us, samples[n].utime_us); };
  const auto near = [&](std::size_t n, std::size_t next) {
    if (std::fabs(t(next) - t(n)) > longest_gap_s) return false;
    const std::size_t apart = next > k ? next - k : k - next;
    return apart <= fewest_neighbours || std::fabs(t(next)) <= half_window_s;
  };
  std::size_t first = k, last = k;
  while (first > 0 && near(first, first - 1)) --first;
  while (last + 1 < samples.size() && near(last, last + 1)) ++last;
  double n = 0, sum_t = 0, sum_tt = 0;
  std::array<double, 2> sum_w{}, sum_tw{};
  for (std::size_t j = first; j <= last; ++j) {
    n += 1;
    sum_t += t(j);
    sum_tt += t(j) * t(j);
    for (std::size_t s : {0u, 1u}) {
      sum_w[s] += samples[j].wheel_velocity_rad_s[s];
      sum_tw[s] += t(j) * samples[j].wheel_velocity_rad_s[s];
    }
  }
  Line line{samples[k].wheel_velocity_rad_s, {}};
  const double determinant = n * sum_tt - sum_t * sum_t;
  if (last - first < 2 || !(determinant > 0)) return line;
  for (std::size_t s : {0u, 1u}) {
    line.slope[s] = (n * sum_tw[s] - sum_t * sum_w[s]) / determinant;
    line.value[s] = (sum_tt * sum_w[s] - sum_t * sum_tw[s]) / determinant;
  }
  return line;
}

// A sample at which the current was refreshed.
struct Refreshed {
  std::size_t sample = 0;
  bool changed = false;
};

// Samples at which the current differs from the one before, and those a period after the last refreshed one,
// where the same value may have been refreshed. Changes within a third of a period belong together (two
// motors read one after the other); the last one counts.
std::vector<Refreshed> refreshed(const std::vector<Sample>& samples, double period_s) {
  std::vector<Refreshed> found;
  std::size_t before = samples.size();
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (!measured(samples[k])) continue;
    const bool first = before == samples.size();
    const bool changed = first || samples[k].battery_current_a != samples[before].battery_current_a;
    before = k;
    const double since_s =
        first ? period_s : seconds(samples[found.back().sample].utime_us, samples[k].utime_us);
    if (changed && since_s < period_s / 3) {
      found.back() = {k, true};
    } else if (changed || since_s > 0.95 * period_s) {
      found.push_back({k, changed});
    }
  }
  return found;
}

// Seconds between changes of the current: the time-weighted lower quartile, because equal successive values
// make longer gaps and motors read one after the other shorter ones. Rests much longer than the usual gap are
// ignored.
double refresh_period_s(std::span<const Recording> missions) {
  std::vector<double> gaps;
  for (const Recording& mission : missions) {
    const Sample* changed = nullptr;
    for (const Sample& s : mission.samples) {
      if (!measured(s) || (changed != nullptr && s.battery_current_a == changed->battery_current_a)) continue;
      if (changed != nullptr) gaps.push_back(seconds(changed->utime_us, s.utime_us));
      changed = &s;
    }
  }
  if (gaps.empty()) return 0;
  const double longest_s = 50 * upper_median(gaps);
  std::erase_if(gaps, [&](double gap) { return gap > longest_s; });
  std::ranges::sort(gaps);
  double total = 0, sum = 0;
  for (const double gap : gaps) total += gap;
  for (const double gap : gaps) {
    sum += gap;
    if (sum >= total / 4) return gap;
  }
  return gaps.back();
}

// The step of a converter: the difference that nearly all neighbouring values are a whole number of.
double step_of(std::span<const Recording> missions, double Sample::*channel) {
  std::vector<double> values;
  for (const Recording& mission : missions) {
    for (const Sample& s : mission.samples) {
      if (measured(s)) values.push_back(s.*channel);
    }
  }
  std::ranges::sort(values);
  if (values.empty()) return 0;
  const double range = values.back() - values.front();
  std::vector<double> steps;
  for (std::size_t k = 1; k < values.size(); ++k) {
    if (values[k] - values[k - 1] > 1e-7 * range) steps.push_back(values[k] - values[k - 1]);
  }
  if (steps.empty()) return 0;
  const double step = *std::ranges::min_element(steps);
  const auto whole = std::ranges::count_if(
      steps, [&](double s) { return std::fabs(s / step - std::round(s / step)) < 0.05; });
  return static_cast<double>(whole) >= 0.95 * static_cast<double>(steps.size()) ? step : 0;
}

// Least squares of the voltage on current and charge drawn, each mission from a level of its own.
double battery_resistance_ohm(std::span<const Recording> missions) {
  double ii = 0, iq = 0, qq = 0, iv = 0, qv = 0;
  for (const Recording& mission : missions) {
    std::vector<std::array<double, 3>> rows;  // current, charge, voltage
    std::array<double, 3> mean{};
    double charge_as = 0;
    const Sample* before = nullptr;
    for (const Sample& s : mission.samples) {
      if (!measured(s)) continue;
      if (before != nullptr) charge_as += s.battery_current_a * seconds(before->utime_us, s.utime_us);
      before = &s;
      rows.push_back({s.battery_current_a, charge_as, s.battery_voltage_v});
      for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += rows.back()[k];
    }
    for (const auto& row : rows) {
      const double n = static_cast<double>(rows.size());
      const double i = row[0] - mean[0] / n, q = row[1] - mean[1] / n, v = row[2] - mean[2] / n;
      ii += i * i;
      iq += i * q;
      qq += q * q;
      iv += i * v;
      qv += q * v;
    }
  }
  const double determinant = ii * qq - iq * iq;
  return determinant > 1e-9 * ii * qq ? std::max(0.0, (iq * qv - qq * iv) / determinant) : 0;
}

}  // namespace

std::vector<Instant> MotionLog::all_instants() const {
  std::vector<Instant> all;
  for (const auto& of_mission : instants) all.insert(all.end(), of_mission.begin(), of_mission.end());
  return all;
}

robot::RobotModel neutral_kinematics() {
  robot::RobotModel robot;
  robot.kinematics = {0.1, 0.25, 0};
  robot.battery.capacity_ah = 20;
  robot.battery.reserve_fraction = 0.1;
  return robot;
}

BatteryChannels battery_channels_of(std::span<const Recording> missions) {
  BatteryChannels battery;
  battery.period_s = refresh_period_s(missions);
  battery.current_step_a = step_of(missions, &Sample::battery_current_a);
  battery.voltage_step_v = step_of(missions, &Sample::battery_voltage_v);
  battery.resistance_ohm = battery_resistance_ohm(missions);
  // The period once more, between changes that belong together.
  std::vector<double> gaps;
  for (const Recording& mission : missions) {
    const auto found = refreshed(mission.samples, battery.period_s);
    for (std::size_t k = 1; k < found.size(); ++k) {
      if (!found[k - 1].changed || !found[k].changed) continue;
      gaps.push_back(
          seconds(mission.samples[found[k - 1].sample].utime_us, mission.samples[found[k].sample].utime_us));
    }
  }
  if (!gaps.empty()) battery.period_s = upper_median(std::move(gaps));
  return battery;
}

std::vector<std::vector<Instant>> instants_of(std::span<const Recording> missions,
                                              const robot::Kinematics& kinematics, double period_s) {
  std::vector<std::vector<Instant>> all;
  double driven_s = 0, travelled_m = 0;
  for (const Recording& mission : missions) {
    const auto& samples = mission.samples;
    std::vector<Instant> instants;
    const auto found = refreshed(samples, period_s);
    auto next = found.begin();
    double x_m = 0, y_m = 0, heading_rad = 0;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const auto& wheel = samples[k].wheel_velocity_rad_s;
      const double r = kinematics.wheel_radius_m, track = 2 * kinematics.half_track_m;
      if (k > 0) {
        const double dt_s = seconds(samples[k - 1].utime_us, samples[k].utime_us);
        const double way_m = dt_s * r * (wheel[0] + wheel[1]) / 2;
        heading_rad += dt_s * r * (wheel[0] - wheel[1]) / track;
        x_m += way_m * std::cos(heading_rad);
        y_m += way_m * std::sin(heading_rad);
        driven_s += dt_s;
        travelled_m += std::fabs(way_m);
      }
      if (next == found.end() || next->sample != k) continue;
      ++next;
      const Line line = line_at(samples, k);
      Instant at;
      at.sample = k;
      at.t_s = seconds(samples.front().utime_us, samples[k].utime_us);
      at.driven_s = driven_s;
      at.travelled_m = travelled_m;
      at.x_m = x_m;
      at.y_m = y_m;
      at.rim_m_s = {r * line.value[0], r * line.value[1]};
      at.speed_m_s = (at.rim_m_s[0] + at.rim_m_s[1]) / 2;
      at.acceleration_m_s2 = r * (line.slope[0] + line.slope[1]) / 2;
      at.yaw_rate_rad_s = (at.rim_m_s[0] - at.rim_m_s[1]) / track;
      at.yaw_acceleration_rad_s2 = r * (line.slope[0] - line.slope[1]) / track;
      at.voltage_v = samples[k].battery_voltage_v;
      at.current_a = samples[k].battery_current_a;
      instants.push_back(at);
    }
    all.push_back(std::move(instants));
  }
  return all;
}

Result<MotionLog> read_motion_log(const std::filesystem::path& path) {
  constexpr std::size_t fewest_instants = 60;
  MotionLog log;
  log.name = path.stem().string();
  const auto beside = std::filesystem::path(path).replace_extension(".json");
  log.kinematics = neutral_kinematics();
  if (std::filesystem::exists(beside)) {
    auto robot = robot::load_robot(beside);
    if (!robot) return tl::unexpected(std::move(robot.error()));
    log.kinematics = std::move(*robot);
    log.own_kinematics = true;
  }
  auto missions = recorded_missions(path);
  if (!missions) return tl::unexpected(std::move(missions.error()));
  log.missions = std::move(*missions);
  log.battery = battery_channels_of(log.missions);
  log.instants = instants_of(log.missions, log.kinematics.kinematics, log.battery.period_s);
  std::size_t count = 0;
  for (const auto& instants : log.instants) count += instants.size();
  if (count < fewest_instants) {
    return fail(Fault::infeasible, path.filename().string(),
                fmt::format("has {} readings of battery power that differ in time, and a trial needs {}",
                            count, fewest_instants));
  }
  return log;
}

}  // namespace joulecast::trial::motion
