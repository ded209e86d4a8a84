#include "report/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gap/verdict/words.h"
#include "report/quantity.h"

namespace joulecast::report {
namespace {

using gap::brief;

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
    ticks.push_back(k * step);
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
    svg_.text({box_.left - 6, py(tick) + 3.5}, brief(tick), {.css = "tick end"});
  }
  if (x_.ticks) {
    for (const double tick : ticks_of(x_.low, x_.high, static_cast<int>(box.width / 75))) {
      const std::string also =
          x_.degrees.empty() ? "" : fmt::format(" ({}{})", brief(in_degrees(tick), 2), x_.degrees);
      category(tick, brief(tick) + also);
    }
  }
  svg_.text({box_.left + box_.width / 2, bottom + bottom_px - 6}, x_.label, {.css = "axis mid"});
  svg_.text({box.left + 12, box_.top + box_.height / 2}, y_.label, {.css = "axis mid", .upwards = true});
}

double Chart::px(double x) const {
  return box_.left + (x - x_.low) / (x_.high - x_.low) * box_.width;
}

double Chart::py(double y) const {
  return box_.top + (y_.high - std::clamp(y, y_.low, y_.high)) / (y_.high - y_.low) * box_.height;
}

void Chart::bar(double from, double to, double base, double value, std::string_view style,
                std::string_view hint) {
  const double a = py(base), b = py(value);
  svg_.rect(px(from) + 1, std::min(a, b), std::max(0.5, px(to) - px(from) - 2),
            std::max(0.8, std::fabs(a - b)), {.css = style, .hint = hint});
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

void Chart::segment(SvgPoint from, SvgPoint to, std::string_view style) {
  svg_.line({px(from.x), py(from.y)}, {px(to.x), py(to.y)}, {.css = style});
}

void Chart::cell(SvgPoint low, SvgPoint high, std::string_view style, double opacity, std::string_view hint) {
  svg_.rect(px(low.x), py(high.y), px(high.x) - px(low.x), py(low.y) - py(high.y),
            {.opacity = opacity, .css = style, .hint = hint});
}

void Chart::level(double y, std::string_view style) {
  segment({x_.low, y}, {x_.high, y}, style);
}

void Chart::category(double x, std::string_view text) {
  svg_.text({px(x), box_.top + box_.height + 15}, text, {.css = "tick mid"});
}

std::string bars(std::span<const BarRow> rows, std::string_view unit, std::string_view name) {
  constexpr double width = 400, value_px = 150, row_px = 44;
  double low = 0, high = 0;
  for (const BarRow& r : rows) {
    for (const double v : {r.value, r.interval[0], r.interval[1], r.mark}) {
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
    }
  }
  if (!(high > low)) high = low + 1;
  const auto px = [&](double v) { return (v - low) / (high - low) * (width - value_px); };
  Svg svg = Svg::part(width, row_px * static_cast<double>(rows.size()), name, "bars");
  double y = 0;
  for (const BarRow& r : rows) {
    svg.text({0, y + 14}, r.label, {.css = "row"});
    const double value = std::isfinite(r.value) ? r.value : 0;
    const double a = px(std::min(0.0, value)), b = px(std::max(0.0, value));
    svg.rect(a, y + 21, std::max(1.0, b - a), 15, {.css = r.style, .hint = r.hint});
    double end = b;
    if (r.interval[1] > r.interval[0]) {
      svg.line({px(r.interval[0]), y + 28.5}, {px(r.interval[1]), y + 28.5}, {.css = "whisker"});
      end = std::max(end, px(r.interval[1]));
    }
    if (std::isfinite(r.mark)) {
      svg.line({px(r.mark), y + 18}, {px(r.mark), y + 39}, {.css = "mark"});
      end = std::max(end, px(r.mark));
    }
    svg.text({end + 8, y + 33}, r.text.empty() ? brief(r.value) + std::string(unit) : r.text, {.css = "row"});
    y += row_px;
  }
  return svg.str();
}

std::string changes(std::span<const ChangeRow> rows, std::string_view axis, std::string_view name) {
  constexpr double width = 720, label = 210, row_px = 20, end_px = 24;
  double low = 0, high = 0;
  for (const ChangeRow& r : rows) {
    low = std::min({low, r.before, r.after});
    high = std::max({high, r.before, r.after});
  }
  if (!(high > low)) high = low + 1;
  const double margin = 0.04 * (high - low);
  low -= margin, high += margin;
  const auto px = [&](double v) { return label + (v - low) / (high - low) * (width - label - end_px); };
  const double height = row_px * static_cast<double>(rows.size()) + 44;
  Svg svg = Svg::part(width, height, name);
  for (const double tick : ticks_of(low, high, 6)) {
    svg.line({px(tick), 4}, {px(tick), height - 38}, {.css = std::fabs(tick) < 1e-12 ? "zero" : "grid"});
    svg.text({px(tick), height - 24}, brief(tick), {.css = "tick mid"});
  }
  double y = 4;
  for (const ChangeRow& r : rows) {
    const double middle = y + row_px / 2;
    svg.text({label - 8, middle + 4}, r.label, {.css = "tick end"});
    svg.line({px(r.before), middle}, {px(r.after), middle}, {.css = "whisker"});
    for (const auto& [value, style] : {std::pair{r.before, "before"}, {r.after, "after"}}) {
      const std::string hint = r.label + ": " + brief(value);
      svg.circle({px(value), middle}, 4.5, {.css = style, .hint = hint});
    }
    y += row_px;
  }
  svg.text({(label + width) / 2, height - 6}, axis, {.css = "axis mid"});
  return svg.str();
}

}  // namespace joulecast::report
