#include "gap/verdict/figures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "gap/verdict/where.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t figure_bins = 9, min_figure_windows = 40;
constexpr double figure_block_s = 8;  // within which readings are not independent
constexpr double stretch_s = 90;      // of power over time
constexpr std::size_t floor_cells = 26, fewest_in_cell = 3, fewest_in_bin = 5;
constexpr std::size_t most_missions = 40;

class Collector {
 public:
  Collector(std::span<const Window> windows, std::span<const double> measured, std::span<const double> before,
            std::span<const double> after)
      : windows_(windows), measured_(measured), before_(before), after_(after) {}

  bool known(std::size_t k) const { return std::isfinite(measured_[k] + before_[k] + after_[k]); }

  Figures::Map map(const std::string& axis, const std::function<double(const Window&)>& value) const {
    std::vector<double> values;
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      if (const double v = value(windows_[k]); known(k) && std::isfinite(v)) values.push_back(v);
    }
    if (values.size() < min_figure_windows) return {};
    // The outermost half percent would extend the axis for a few windows.
    const double low = statistics::quantile(values, 0.005), high = statistics::quantile(values, 0.995);
    if (!(high - low > 1e-6 * std::max(std::fabs(high), 1.0))) return {};
    std::vector<std::vector<std::size_t>> members(figure_bins);
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      const double at = value(windows_[k]);
      if (!known(k) || !(at >= low && at <= high)) continue;
      members[std::min(figure_bins - 1, static_cast<std::size_t>((at - low) / (high - low) * figure_bins))]
          .push_back(k);
    }
    Figures::Map map{axis, {}};
    for (std::size_t b = 0; b < figure_bins; ++b) {
      const double width = (high - low) / figure_bins, from = low + width * static_cast<double>(b);
      map.bins.push_back(bin(members[b], from, from + width, ""));
    }
    return map;
  }

  Figures::Map phases(double wheel_radius_m) const {
    Figures::Map map{"phase", {}};
    const std::array<std::string, 5> names{"standstill", "acceleration", "cruise", "braking", "turning"};
    for (std::size_t n = 0; n < names.size(); ++n) {
      std::vector<std::size_t> members;
      for (std::size_t k = 0; k < windows_.size(); ++k) {
        if (known(k) && phase_of(windows_[k], wheel_radius_m) == names[n]) members.push_back(k);
      }
      const double from = static_cast<double>(n);
      map.bins.push_back(bin(members, from, from + 1, names[n]));
    }
    return map;
  }

  void floor(Figures& figures) const {
    double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      const Window& w = windows_[k];
      if (!known(k) || !std::isfinite(w.x_m + w.y_m)) continue;
      x0 = std::min(x0, w.x_m), x1 = std::max(x1, w.x_m);
      y0 = std::min(y0, w.y_m), y1 = std::max(y1, w.y_m);
    }
    if (!(std::max(x1 - x0, y1 - y0) > 0.5)) return;
    figures.cell_m = std::max(x1 - x0, y1 - y0) / floor_cells;
    std::map<std::pair<int, int>, std::vector<std::size_t>> cells;
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      const Window& w = windows_[k];
      if (!known(k) || !std::isfinite(w.x_m + w.y_m)) continue;
      cells[{static_cast<int>((w.x_m - x0) / figures.cell_m),
             static_cast<int>((w.y_m - y0) / figures.cell_m)}]
          .push_back(k);
    }
    for (const auto& [at, members] : cells) {
      if (members.size() < fewest_in_cell) continue;
      const Figures::Bin b = bin(members, 0, 0, "");
      figures.floor.push_back({x0 + at.first * figures.cell_m, y0 + at.second * figures.cell_m, b.before_w,
                               b.after_w, members.size()});
    }
  }

  // The interval in which the model's power error is largest.
  void power(Figures& figures, const telemetry::RecordingSet& recordings) const {
    std::map<std::pair<std::size_t, int>, double> halves;
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      if (known(k))
        halves[{windows_[k].mission, static_cast<int>(windows_[k].t_s / (stretch_s / 2))}] +=
            std::fabs(measured_[k] - before_[k]);
    }
    if (halves.empty()) return;
    std::pair<std::size_t, int> worst = halves.begin()->first;
    double most = -1;
    for (const auto& [at, sum] : halves) {
      const auto next = halves.find({at.first, at.second + 1});
      const double both = sum + (next == halves.end() ? 0 : next->second);
      if (both > most) most = both, worst = at;
    }
    const double from = worst.second * stretch_s / 2;
    figures.stretch_of = recordings.missions[worst.first].mission_id;
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      const Window& w = windows_[k];
      if (w.mission != worst.first || w.t_s < from || w.t_s > from + stretch_s || !known(k)) continue;
      if (!w.continues && !figures.power.empty()) figures.power.push_back({w.t_s, missing, missing, missing});
      figures.power.push_back({w.t_s, measured_[k], before_[k], after_[k]});
    }
  }

  void missions(Figures& figures, const telemetry::RecordingSet& recordings) const {
    struct Total {
      double measured = 0, gap = 0, rest = 0, absolute = 0, absolute_after = 0, size = 0;
    };
    std::map<std::size_t, Total> totals;
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      if (!known(k)) continue;
      Total& t = totals[windows_[k].mission];
      t.measured += measured_[k];
      t.gap += measured_[k] - before_[k];
      t.rest += measured_[k] - after_[k];
      t.absolute += std::fabs(measured_[k] - before_[k]);
      t.absolute_after += std::fabs(measured_[k] - after_[k]);
      t.size += std::fabs(measured_[k]);
    }
    for (const auto& [m, t] : totals) {
      if (figures.missions.size() >= most_missions) break;
      const telemetry::Recording& mission = recordings.missions[m];
      const std::int64_t start = mission.samples.front().utime_us;
      figures.missions.push_back({mission.mission_id, start,
                                  1e-6 * static_cast<double>(mission.samples.back().utime_us - start),
                                  mission.payload_kg, t.gap / t.measured, t.rest / t.measured,
                                  t.absolute / t.size, t.absolute_after / t.size});
    }
  }

  double mean_power() const {
    double sum = 0, count = 0;
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      if (known(k)) sum += std::fabs(measured_[k]), ++count;
    }
    return count > 0 ? sum / count : 0;
  }

 private:
  Figures::Bin bin(const std::vector<std::size_t>& members, double from, double to, std::string label) const {
    Figures::Bin b{from, to, 0, 0, missing, members.size(), std::move(label)};
    if (members.size() < fewest_in_cell) return b;
    std::map<std::pair<std::size_t, int>, std::pair<double, double>> blocks;  // sum, count
    for (const std::size_t k : members) {
      b.before_w += measured_[k] - before_[k];
      b.after_w += measured_[k] - after_[k];
      auto& [sum, count] = blocks[{windows_[k].mission, static_cast<int>(windows_[k].t_s / figure_block_s)}];
      sum += measured_[k] - before_[k];
      ++count;
    }
    const double n = static_cast<double>(members.size()), many = static_cast<double>(blocks.size());
    b.before_w /= n;
    b.after_w /= n;
    if (blocks.size() < 3 || members.size() < fewest_in_bin) return b;
    double square = 0;
    for (const auto& [key, block] : blocks) square += std::pow(block.first - b.before_w * block.second, 2);
    b.half_width_w = 1.96 * std::sqrt(square * many / (many - 1)) / n;
    return b;
  }

  std::span<const Window> windows_;
  std::span<const double> measured_, before_, after_;
};

}  // namespace

Figures figures_of(std::span<const Window> windows, std::span<const double> measured_w,
                   std::span<const double> before_w, std::span<const double> after_w,
                   const telemetry::RecordingSet& recordings, const robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m, l = robot.kinematics.half_track_m;
  const Collector collect(windows, measured_w, before_w, after_w);
  Figures figures;
  figures.mean_power_w = collect.mean_power();
  if (!(figures.mean_power_w > 0)) return figures;
  figures.maps.push_back(collect.phases(r));
  const std::array<std::pair<const char*, std::function<double(const Window&)>>, 6> variables{
      {{"speed, m/s", [r](const Window& w) { return 0.5 * r * (w.speed_rad_s[0] + w.speed_rad_s[1]); }},
       {"acceleration, m/s²",
        [r](const Window& w) { return 0.5 * r * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]); }},
       {"yaw rate, rad/s (left positive)",
        [r, l](const Window& w) { return r * (w.speed_rad_s[0] - w.speed_rad_s[1]) / (2 * l); }},
       {"payload, kg", [](const Window& w) { return w.payload_kg; }},
       {"time since the mission began, s", [](const Window& w) { return w.t_s; }},
       {"heading, degrees", [](const Window& w) {
          return std::isfinite(w.heading_rad)
                     ? std::remainder(w.heading_rad, 2 * std::numbers::pi) * 180 / std::numbers::pi
                     : missing;
        }}}};
  for (const auto& [axis, value] : variables) {
    if (Figures::Map map = collect.map(axis, value); !map.bins.empty())
      figures.maps.push_back(std::move(map));
  }
  collect.floor(figures);
  collect.power(figures, recordings);
  collect.missions(figures, recordings);
  return figures;
}

}  // namespace joulecast::gap
