#include "gap/verdict/where.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <ranges>

#include "statistics/distributions.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr double where_block_s = 8;
constexpr double min_where_share = 0.03;  // of the gap, beyond the share of the time
constexpr double beyond_noise = 1.3;
constexpr std::size_t most_regions = 24;
constexpr std::array phase_names{"standstill", "acceleration", "cruise", "braking", "turning"};

// Index of its name.
std::size_t phase_of(const Window& w, double radius) {
  const double speed = 0.5 * radius * (w.speed_rad_s[0] + w.speed_rad_s[1]);
  const double acceleration = 0.5 * radius * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  const double rim = 0.5 * radius * std::fabs(w.speed_rad_s[0] - w.speed_rad_s[1]);
  if (w.resting[0] && w.resting[1]) return 0;
  if (rim > 0.3 * std::max(std::fabs(speed), 0.02)) return 4;
  const double along = speed >= 0 ? acceleration : -acceleration;
  if (along > 0.08) return 1;
  if (along < -0.08) return 3;
  return 2;
}

// The windows of a phase, a range of a variable, or a square of the floor with its lower corner at (from,
// to).
struct Region {
  std::string label;
  double from = 0, to = 0;
  std::vector<std::size_t> windows;
};

std::vector<Region> phases_of(std::span<const Window> windows, double wheel_radius_m) {
  std::vector<Region> phases;
  for (std::size_t n = 0; n < phase_names.size(); ++n)
    phases.push_back({phase_names[n], static_cast<double>(n), static_cast<double>(n + 1), {}});
  for (std::size_t k = 0; k < windows.size(); ++k)
    phases[phase_of(windows[k], wheel_radius_m)].windows.push_back(k);
  return phases;
}

// Equal ranges between the quantiles `outermost` and 1 - `outermost`; empty where all windows have one value.
std::vector<Region> ranges_of(std::span<const Window> windows,
                              const std::function<double(const Window&)>& value, std::size_t count,
                              double outermost = 0) {
  std::vector<double> known;
  for (const Window& w : windows)
    if (const double v = value(w); std::isfinite(v)) known.push_back(v);
  if (known.empty()) return {};
  const double low = statistics::quantile(known, outermost),
               high = statistics::quantile(known, 1 - outermost),
               width = (high - low) / static_cast<double>(count);
  if (!(high - low > 1e-6 * std::max(std::fabs(high), 1.0))) return {};
  std::vector<Region> ranges;
  for (std::size_t b = 0; b < count; ++b) {
    const double from = low + width * static_cast<double>(b);
    ranges.push_back({"", from, from + width, {}});
  }
  for (std::size_t k = 0; k < windows.size(); ++k)
    if (const double v = value(windows[k]); v >= low && v <= high)
      ranges[std::min(count - 1, static_cast<std::size_t>((v - low) / width))].windows.push_back(k);
  return ranges;
}

// Squares with a side of 1 / count of the visited extent; empty where they would not be larger than
// `least_m`.
std::vector<Region> squares_of(std::span<const Window> windows, int count, double least_m, double& side_m) {
  std::vector<double> x, y;
  for (const Window& w : windows)
    if (std::isfinite(w.x_m + w.y_m)) x.push_back(w.x_m), y.push_back(w.y_m);
  if (x.empty()) return {};
  const auto [x0, x1] = std::ranges::minmax(x);
  const auto [y0, y1] = std::ranges::minmax(y);
  const double side = std::max(x1 - x0, y1 - y0) / count;
  if (!(side > least_m)) return {};
  side_m = side;
  std::map<std::pair<int, int>, Region> squares;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    const Window& w = windows[k];
    if (!std::isfinite(w.x_m + w.y_m)) continue;
    const int i = static_cast<int>((w.x_m - x0) / side_m), j = static_cast<int>((w.y_m - y0) / side_m);
    Region& square =
        squares.try_emplace({i, j}, Region{"", x0 + i * side_m, y0 + j * side_m, {}}).first->second;
    square.windows.push_back(k);
  }
  const auto regions = squares | std::views::values;
  return {regions.begin(), regions.end()};
}

// Sums over blocks within which readings are not independent, and the number of windows of each.
std::vector<std::pair<double, double>> block_sums(std::span<const Window> windows, const Region& region,
                                                  std::span<const double> residual_w) {
  std::map<std::pair<std::size_t, int>, std::pair<double, double>> blocks;
  for (const std::size_t k : region.windows) {
    auto& [sum, count] = blocks[{windows[k].mission, static_cast<int>(windows[k].t_s / where_block_s)}];
    sum += residual_w[k];
    ++count;
  }
  const auto sums = blocks | std::views::values;
  return {sums.begin(), sums.end()};
}

// Regions of one variable.
struct Variable {
  std::string name;
  std::vector<Region> regions;
};

// A number of each window, in regions and on the axis of a chart.
struct Axis {
  const char *variable, *title;
  std::size_t ranges;  // regions
  std::function<double(const Window&)> value, drawn;
};

std::vector<Axis> axes_of(const robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m, l = robot.kinematics.half_track_m;
  const auto speed = [=](const Window& w) { return 0.5 * r * (w.speed_rad_s[0] + w.speed_rad_s[1]); };
  const auto acceleration = [=](const Window& w) {
    return 0.5 * r * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  };
  const auto yaw_rate = [=](const Window& w) { return r * (w.speed_rad_s[0] - w.speed_rad_s[1]) / (2 * l); };
  const auto heading = [](const Window& w) { return std::remainder(w.heading_rad, 2 * std::numbers::pi); };
  return {{"speed_m_s", "speed, m/s", 6, [=](const Window& w) { return std::fabs(speed(w)); }, speed},
          {"acceleration_m_s2", "acceleration, m/s²", 6, acceleration, acceleration},
          {"yaw_rate_rad_s", "yaw rate, rad/s (left positive)", 6, yaw_rate, yaw_rate},
          {"payload_kg", "payload, kg", 4, &Window::payload_kg, &Window::payload_kg},
          {"time_s", "time since the mission began, s", 6, &Window::t_s, &Window::t_s},
          {"heading_rad", "heading, degrees", 8, heading,
           [=](const Window& w) { return heading(w) * 180 / std::numbers::pi; }}};
}

std::vector<Variable> variables_of(std::span<const Window> windows, const robot::RobotModel& robot) {
  double side_m = 0;
  std::vector<Region> squares = squares_of(windows, 10, 0.05, side_m);
  for (Region& one : squares)
    one.label = fmt::format("x {:.1f} to {:.1f}, y {:.1f} to {:.1f}", one.from, one.from + side_m, one.to,
                            one.to + side_m);
  std::vector<Variable> all{{"phase", phases_of(windows, robot.kinematics.wheel_radius_m)}};
  for (const Axis& axis : axes_of(robot))
    all.push_back({axis.variable, ranges_of(windows, axis.value, axis.ranges)});
  all.push_back({"floor_m", std::move(squares)});
  for (Variable& one : all) std::erase_if(one.regions, [](const Region& g) { return g.windows.size() < 5; });
  return all;
}

constexpr std::size_t figure_bins = 9;
constexpr int min_figure_windows = 40;
constexpr double stretch_s = 90;  // of power over time
constexpr int floor_cells = 26;
constexpr std::size_t fewest_in_cell = 3, fewest_in_bin = 5;
constexpr std::size_t most_missions = 40;

class Collector {
 public:
  Collector(std::span<const Window> windows, std::span<const double> measured, std::span<const double> before,
            std::span<const double> after)
      : windows_(windows), measured_(measured), before_(before), after_(after) {
    for (std::size_t k = 0; k < windows.size(); ++k) {
      residual_before_.push_back(measured[k] - before[k]);
      residual_after_.push_back(measured[k] - after[k]);
    }
  }

  std::vector<Figures::Bin> bins(const std::vector<Region>& regions, std::size_t fewest = 0) const {
    std::vector<Figures::Bin> bins;
    for (const Region& region : regions)
      if (region.windows.size() >= fewest) bins.push_back(bin(region));
    return bins;
  }

  // The interval in which the model's power error is largest.
  void power(Figures& figures, const telemetry::RecordingSet& recordings) const {
    std::map<std::pair<std::size_t, int>, double> halves;
    for (std::size_t k = 0; k < windows_.size(); ++k)
      halves[{windows_[k].mission, static_cast<int>(windows_[k].t_s / (stretch_s / 2))}] +=
          std::fabs(residual_before_[k]);
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
      if (w.mission != worst.first || w.t_s < from || w.t_s > from + stretch_s) continue;
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
      Total& t = totals[windows_[k].mission];
      t.measured += measured_[k];
      t.gap += residual_before_[k];
      t.rest += residual_after_[k];
      t.absolute += std::fabs(residual_before_[k]);
      t.absolute_after += std::fabs(residual_after_[k]);
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

 private:
  Figures::Bin bin(const Region& region) const {
    Figures::Bin b{region.from, region.to, 0, 0, missing, region.windows.size(), region.label};
    if (b.windows < fewest_in_cell) return b;
    const double n = static_cast<double>(b.windows);
    for (const std::size_t k : region.windows) {
      b.before_w += residual_before_[k];
      b.after_w += residual_after_[k];
    }
    b.before_w /= n;
    b.after_w /= n;
    const auto blocks = block_sums(windows_, region, residual_before_);
    if (blocks.size() < 3 || b.windows < fewest_in_bin) return b;
    double square = 0;
    for (const auto& [sum, count] : blocks) square += std::pow(sum - b.before_w * count, 2);
    const double many = static_cast<double>(blocks.size());
    b.half_width_w = 1.96 * std::sqrt(square * many / (many - 1)) / n;
    return b;
  }

  std::span<const Window> windows_;
  std::span<const double> measured_, before_, after_;
  std::vector<double> residual_before_, residual_after_;
};

}  // namespace

std::vector<WhereRegion> localise(std::span<const Window> windows, const robot::RobotModel& robot,
                                  std::span<const double> measured_w, std::span<const double> modelled_w,
                                  double noise_floor, const std::string& channel) {
  const std::vector<Variable> variables = variables_of(windows, robot);
  std::vector<double> residual_w;
  double total = 0, size = 0, looks = 0;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    residual_w.push_back(measured_w[k] - modelled_w[k]);
    total += std::fabs(residual_w[k]);
    size += std::fabs(measured_w[k]);
  }
  std::vector<WhereRegion> found;
  if (total <= 0 || total / size < beyond_noise * noise_floor) return found;
  for (const Variable& variable : variables) looks += static_cast<double>(variable.regions.size());
  const double quantile = statistics::normal_quantile(1 - 0.025 / looks);
  for (const auto& [name, regions] : variables) {
    for (const Region& region : regions) {
      const auto blocks = block_sums(windows, region, residual_w);
      if (blocks.size() < 3) continue;
      double sum = 0, variance = 0;
      for (const auto& block : blocks) sum += block.first;
      const double n = static_cast<double>(blocks.size());
      for (const auto& block : blocks) variance += std::pow(block.first - sum / n, 2);
      const double most = quantile * std::sqrt(variance * n / (n - 1)), share = sum / total;
      const double time_share =
          static_cast<double>(region.windows.size()) / static_cast<double>(windows.size());
      if (std::fabs(sum) < most || std::fabs(share) - time_share < min_where_share) continue;
      found.push_back({channel,
                       name,
                       region.label,
                       region.from,
                       region.to,
                       share,
                       time_share,
                       {(sum - most) / total, (sum + most) / total}});
    }
  }
  std::ranges::stable_sort(found, std::greater{},
                           [](const WhereRegion& w) { return std::fabs(w.share) - w.time_share; });
  if (found.size() > most_regions) found.resize(most_regions);
  return found;
}

Figures figures_of(std::span<const Window> windows, std::span<const double> measured_w,
                   std::span<const double> before_w, std::span<const double> after_w,
                   const telemetry::RecordingSet& recordings, const robot::RobotModel& robot) {
  const Collector collect(windows, measured_w, before_w, after_w);
  Figures figures;
  for (const double w : measured_w) figures.mean_power_w += std::fabs(w);
  figures.mean_power_w /= static_cast<double>(windows.size());
  if (!(figures.mean_power_w > 0)) return figures;
  figures.maps.push_back({"phase", collect.bins(phases_of(windows, robot.kinematics.wheel_radius_m))});
  for (const Axis& axis : axes_of(robot)) {
    const auto known = [&](const Window& w) { return std::isfinite(axis.drawn(w)); };
    if (std::ranges::count_if(windows, known) < min_figure_windows) continue;
    // The outermost half percent would extend the axis for a few windows.
    if (const auto ranges = ranges_of(windows, axis.drawn, figure_bins, 0.005); !ranges.empty())
      figures.maps.push_back({axis.title, collect.bins(ranges)});
  }
  figures.floor =
      collect.bins(squares_of(windows, floor_cells, 0.5 / floor_cells, figures.cell_m), fewest_in_cell);
  collect.power(figures, recordings);
  collect.missions(figures, recordings);
  return figures;
}

}  // namespace joulecast::gap
