#include "gap/verdict/where.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "statistics/distributions.h"

namespace joulecast::gap {
namespace {

constexpr double where_block_s = 8;
constexpr double min_where_share = 0.03;  // of the gap, beyond the share of the time
constexpr double beyond_noise = 1.3;
constexpr std::size_t most_regions = 24;

struct Part {
  std::string channel;
  std::vector<double> residual_w;
};

struct Region {
  std::string variable, label;
  double from = 0, to = 0;
  std::vector<std::size_t> windows;
};

std::vector<Part> parts_of(std::span<const Window> windows, const robot::RobotModel& robot,
                           std::span<const dynamics::ActiveEffect> adopted,
                           std::span<const double> measured_w, std::span<const double> modelled_w) {
  const std::size_t n = windows.size();
  std::vector<Part> parts{{"battery_power", std::vector<double>(n)}};
  const dynamics::DriveModel model(robot, adopted);
  Part bus{std::string(name_of(Channel::bus)), std::vector<double>(n, 0.0)};
  Part voltage{std::string(name_of(Channel::voltage_right)), std::vector<double>(n, 0.0)};
  Part torque{std::string(name_of(Channel::torque_right)), std::vector<double>(n, 0.0)};
  std::size_t motors = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const Window& w = windows[k];
    parts[0].residual_w[k] = measured_w[k] - modelled_w[k];
    const ChannelValues<double> r = residuals(model, w, false);
    const double electrical = r[0] * w.current_a[0] + r[1] * w.current_a[1];
    const double at_bus = r[index_of(Channel::bus)];
    if (!std::isfinite(parts[0].residual_w[k] + electrical + at_bus)) continue;
    bus.residual_w[k] = at_bus;
    voltage.residual_w[k] = electrical;
    torque.residual_w[k] = parts[0].residual_w[k] - at_bus - electrical;
    ++motors;
  }
  if (motors > n / 2) {
    for (Part* part : {&bus, &voltage, &torque}) parts.push_back(std::move(*part));
  }
  return parts;
}

void add_bins(std::vector<Region>& regions, std::span<const Window> windows, const std::string& variable,
              std::size_t bins, auto&& value) {
  double low = 1e300, high = -1e300;
  for (const Window& w : windows) {
    const double v = value(w);
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (!(high > low)) return;
  const std::size_t first = regions.size();
  const double width = (high - low) / static_cast<double>(bins);
  for (std::size_t b = 0; b < bins; ++b) {
    const double from = low + width * static_cast<double>(b);
    regions.push_back({variable, "", from, from + width, {}});
  }
  for (std::size_t k = 0; k < windows.size(); ++k) {
    const double v = value(windows[k]);
    if (!std::isfinite(v)) continue;
    regions[first + std::min(bins - 1, static_cast<std::size_t>((v - low) / width))].windows.push_back(k);
  }
}

// Squares of the floor; the side is a tenth of the visited extent.
void add_cells(std::vector<Region>& regions, std::span<const Window> windows) {
  double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
  for (const Window& w : windows) {
    if (!std::isfinite(w.x_m + w.y_m)) continue;
    x0 = std::min(x0, w.x_m), x1 = std::max(x1, w.x_m);
    y0 = std::min(y0, w.y_m), y1 = std::max(y1, w.y_m);
  }
  const double side = 0.1 * std::max(x1 - x0, y1 - y0);
  if (!(side > 0.05)) return;
  std::map<std::pair<int, int>, std::vector<std::size_t>> cells;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    const Window& w = windows[k];
    if (!std::isfinite(w.x_m + w.y_m)) continue;
    const std::pair at{static_cast<int>((w.x_m - x0) / side), static_cast<int>((w.y_m - y0) / side)};
    cells[at].push_back(k);
  }
  for (const auto& [at, members] : cells)
    regions.push_back(
        {"floor_m",
         fmt::format("x {:.1f} to {:.1f}, y {:.1f} to {:.1f}", x0 + at.first * side,
                     x0 + (at.first + 1) * side, y0 + at.second * side, y0 + (at.second + 1) * side),
         0, 0, members});
}

std::vector<Region> regions_of(std::span<const Window> windows, const robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m, l = robot.kinematics.half_track_m;
  std::vector<Region> regions;
  std::map<std::string, std::vector<std::size_t>> phases;
  for (std::size_t k = 0; k < windows.size(); ++k) phases[std::string(phase_of(windows[k], r))].push_back(k);
  for (const auto& [phase, members] : phases) regions.push_back({"phase", phase, 0, 0, members});
  add_bins(regions, windows, "speed_m_s", 6,
           [r](const Window& w) { return 0.5 * r * std::fabs(w.speed_rad_s[0] + w.speed_rad_s[1]); });
  add_bins(regions, windows, "acceleration_m_s2", 6,
           [r](const Window& w) { return 0.5 * r * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]); });
  add_bins(regions, windows, "yaw_rate_rad_s", 6,
           [r, l](const Window& w) { return r * (w.speed_rad_s[0] - w.speed_rad_s[1]) / (2 * l); });
  add_bins(regions, windows, "payload_kg", 4, [](const Window& w) { return w.payload_kg; });
  add_bins(regions, windows, "time_s", 6, [](const Window& w) { return w.t_s; });
  add_bins(regions, windows, "heading_rad", 8, [](const Window& w) {
    return std::isfinite(w.heading_rad) ? std::remainder(w.heading_rad, 2 * std::numbers::pi) : missing;
  });
  add_cells(regions, windows);
  std::erase_if(regions, [](const Region& g) { return g.windows.size() < 5; });
  return regions;
}

}  // namespace

std::string_view phase_of(const Window& w, double radius) {
  const double speed = 0.5 * radius * (w.speed_rad_s[0] + w.speed_rad_s[1]);
  const double acceleration = 0.5 * radius * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  const double rim = 0.5 * radius * std::fabs(w.speed_rad_s[0] - w.speed_rad_s[1]);
  if (w.resting[0] && w.resting[1]) return "standstill";
  if (rim > 0.3 * std::max(std::fabs(speed), 0.02)) return "turning";
  const double along = speed >= 0 ? acceleration : -acceleration;
  if (along > 0.08) return "acceleration";
  if (along < -0.08) return "braking";
  return "cruise";
}

std::vector<WhereRegion> localise(std::span<const Window> windows, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> adopted,
                                  std::span<const double> measured_w, std::span<const double> modelled_w,
                                  double noise_floor) {
  const std::vector<Part> parts = parts_of(windows, robot, adopted, measured_w, modelled_w);
  const std::vector<Region> regions = regions_of(windows, robot);
  double total = 0, size = 0, known = 0;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    const double e = parts[0].residual_w[k];
    if (!std::isfinite(e)) continue;
    total += std::fabs(e);
    size += std::fabs(measured_w[k]);
    ++known;
  }
  std::vector<WhereRegion> found;
  if (total <= 0 || total / size < beyond_noise * noise_floor) return found;
  const double looks = static_cast<double>(regions.size() * parts.size());
  const double quantile = statistics::normal_quantile(1 - 0.025 / looks);
  for (const Part& part : parts) {
    for (const Region& region : regions) {
      std::map<std::pair<std::size_t, int>, double> blocks;
      double sum = 0, count = 0;
      for (const std::size_t k : region.windows) {
        const double e = part.residual_w[k];
        if (!std::isfinite(e)) continue;
        sum += e;
        ++count;
        blocks[{windows[k].mission, static_cast<int>(windows[k].t_s / where_block_s)}] += e;
      }
      if (blocks.size() < 3) continue;
      const double n = static_cast<double>(blocks.size()), mean = sum / n;
      double variance = 0;
      for (const auto& [key, value] : blocks) variance += (value - mean) * (value - mean);
      const double deviation = std::sqrt(variance * n / (n - 1));
      const double share = sum / total, time_share = count / known;
      if (std::fabs(sum) < quantile * deviation || std::fabs(share) - time_share < min_where_share) continue;
      const auto same = std::ranges::find_if(found, [&](const WhereRegion& w) {
        return w.variable == region.variable && w.label == region.label && w.from == region.from &&
               (w.share > 0) == (share > 0);
      });
      WhereRegion here{
          part.channel, region.variable,
          region.label, region.from,
          region.to,    share,
          time_share,   {(sum - quantile * deviation) / total, (sum + quantile * deviation) / total}};
      if (same == found.end()) {
        found.push_back(std::move(here));
      } else if (std::fabs(same->share) < std::fabs(share)) {
        *same = std::move(here);
      }
    }
  }
  std::ranges::stable_sort(found, std::greater{},
                           [](const WhereRegion& w) { return std::fabs(w.share) - w.time_share; });
  if (found.size() > most_regions) found.resize(most_regions);
  return found;
}

}  // namespace joulecast::gap
