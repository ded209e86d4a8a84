#include "report/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace joulecast::report {
namespace {

constexpr double left_px = 52, right_px = 12, top_px = 10, bottom_px = 40;

}  // namespace

std::vector<double> ticks_of(double low, double high, int about) {
  const double raw = (high - low) / about;
  const double power = std::pow(10, std::floor(std::log10(raw)));
  double step = 10 * power;
  for (const double m : {1.0, 2.0, 2.5, 5.0}) {
    if (raw <= m * power) {
      step = m * power;
      break;
    }
  }
  std::vector<double> ticks;
  for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k)
    ticks.push_back(k * step + 0.0);  // no negative zero
  return ticks;
}

Chart::Chart(Svg& svg, Box box, Axis x, Axis y)
    : svg_(svg),
      box_{box.left + left_px, box.top + top_px, box.width - left_px - right_px,
           box.height - top_px - bottom_px},
      x_(std::move(x)),
      y_(std::move(y)) {
  if (!(x_.high > x_.low)) x_.high = x_.low + 1;
  if (!(y_.high > y_.low)) y_.high = y_.low + 1;
  const double right = box_.left + box_.width, bottom = box_.top + box_.height;
  for (const double tick : ticks_of(y_.low, y_.high, 4)) {
    svg_.line({box_.left, py(tick)}, {right, py(tick)}, {.css = "grid"});
    svg_.text({box_.left - 6, py(tick) + 3.5}, fmt::format("{:.7g}", tick), {.css = "tick end"});
  }
  for (const double tick : ticks_of(x_.low, x_.high, static_cast<int>(box.width / 75)))
    svg_.text({px(tick), bottom + 15}, fmt::format("{:.7g}", tick), {.css = "tick mid"});
  svg_.text({box_.left + box_.width / 2, bottom + bottom_px - 6}, x_.label, {.css = "axis mid"});
  svg_.text({box.left + 12, box_.top + box_.height / 2}, y_.label, {.css = "axis mid", .upwards = true});
}

double Chart::px(double x) const {
  return box_.left + (x - x_.low) / (x_.high - x_.low) * box_.width;
}

double Chart::py(double y) const {
  return box_.top + (y_.high - std::clamp(y, y_.low, y_.high)) / (y_.high - y_.low) * box_.height;
}

void Chart::line(std::span<const SvgPoint> points, std::string_view style) {
  std::vector<SvgPoint> part;
  const auto end = [&] {
    if (!part.empty()) svg_.polyline(part, {.css = style});
    part.clear();
  };
  for (const SvgPoint& p : points) {
    if (std::isfinite(p.y))
      part.push_back({px(p.x), py(p.y)});
    else
      end();
  }
  end();
}

void Chart::level(double y, std::string_view style) {
  svg_.line({px(x_.low), py(y)}, {px(x_.high), py(y)}, {.css = style});
}

}  // namespace joulecast::report
