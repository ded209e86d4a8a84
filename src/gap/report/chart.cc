#include "gap/report/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/xml_text.h"
#include "gap/report/quantity.h"
#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

constexpr double left_px = 52, right_px = 12, top_px = 10, bottom_px = 40;

std::string px_text(double v) {
  return fmt::format("{:.1f}", v);
}

std::string title(std::string_view hint) {
  return hint.empty() ? std::string() : "<title>" + xml_escaped(hint) + "</title>";
}

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

Chart::Chart(double width, double height, Axis x, Axis y, std::string_view name)
    : width_(width), height_(height), x_(std::move(x)), y_(std::move(y)) {
  if (!(x_.high > x_.low)) x_.high = x_.low + 1;
  if (!(y_.high > y_.low)) y_.high = y_.low + 1;
  auto out = std::back_inserter(body_);
  fmt::format_to(out, "<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">", width, height,
                 xml_escaped(name));
  for (const double y_tick : ticks_of(y_.low, y_.high, 4)) {
    fmt::format_to(out, "<line class=\"grid\" x1=\"{0}\" x2=\"{1}\" y1=\"{2}\" y2=\"{2}\"/>", left_px,
                   px_text(width - right_px), px_text(py(y_tick)));
    fmt::format_to(out, "<text class=\"tick end\" x=\"{}\" y=\"{}\">{}</text>", left_px - 6,
                   px_text(py(y_tick) + 3.5), brief(y_tick));
  }
  if (x_.ticks) {
    for (const double x_tick : ticks_of(x_.low, x_.high, static_cast<int>(width / 75))) {
      const std::string also =
          x_.degrees.empty() ? "" : fmt::format(" ({}{})", brief(in_degrees(x_tick), 2), x_.degrees);
      fmt::format_to(out, "<text class=\"tick mid\" x=\"{}\" y=\"{}\">{}{}</text>", px_text(px(x_tick)),
                     px_text(height - bottom_px + 15), brief(x_tick), also);
    }
  }
  fmt::format_to(out, "<text class=\"axis mid\" x=\"{}\" y=\"{}\">{}</text>",
                 px_text((left_px + width - right_px) / 2), px_text(height - 6), xml_escaped(x_.label));
  fmt::format_to(out, "<text class=\"axis mid\" transform=\"translate(12 {}) rotate(-90)\">{}</text>",
                 px_text((top_px + height - bottom_px) / 2), xml_escaped(y_.label));
}

double Chart::px(double x) const {
  return left_px + (x - x_.low) / (x_.high - x_.low) * (width_ - left_px - right_px);
}

double Chart::py(double y) const {
  return height_ - bottom_px - (y - y_.low) / (y_.high - y_.low) * (height_ - top_px - bottom_px);
}

void Chart::bar(double from, double to, double base, double value, std::string_view style,
                std::string_view hint) {
  const double a = py(std::clamp(base, y_.low, y_.high)), b = py(std::clamp(value, y_.low, y_.high));
  fmt::format_to(
      std::back_inserter(body_), "<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\">{}</rect>",
      style, px_text(px(from) + 1), px_text(std::min(a, b)), px_text(std::max(0.5, px(to) - px(from) - 2)),
      px_text(std::max(0.8, std::fabs(a - b))), title(hint));
}

void Chart::line(std::span<const ChartPoint> points, std::string_view style) {
  auto out = std::back_inserter(body_);
  bool open = false;
  for (const ChartPoint& p : points) {
    if (!std::isfinite(p.y)) {
      if (open) body_ += "\"/>";
      open = false;
      continue;
    }
    if (!open) fmt::format_to(out, "<polyline class=\"{}\" points=\"", style);
    open = true;
    fmt::format_to(out, "{},{} ", px_text(px(p.x)), px_text(py(std::clamp(p.y, y_.low, y_.high))));
  }
  if (open) body_ += "\"/>";
}

void Chart::dot(ChartPoint at, std::string_view style, std::string_view hint, double radius) {
  if (!std::isfinite(at.y)) return;
  fmt::format_to(std::back_inserter(body_), "<circle class=\"{}\" cx=\"{}\" cy=\"{}\" r=\"{}\">{}</circle>",
                 style, px_text(px(at.x)), px_text(py(std::clamp(at.y, y_.low, y_.high))), radius,
                 title(hint));
}

void Chart::segment(ChartPoint from, ChartPoint to, std::string_view style) {
  fmt::format_to(std::back_inserter(body_), "<line class=\"{}\" x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\"/>",
                 style, px_text(px(from.x)), px_text(py(std::clamp(from.y, y_.low, y_.high))),
                 px_text(px(to.x)), px_text(py(std::clamp(to.y, y_.low, y_.high))));
}

void Chart::cell(ChartPoint low, ChartPoint high, std::string_view style, double opacity,
                 std::string_view hint) {
  fmt::format_to(
      std::back_inserter(body_),
      "<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill-opacity=\"{:.2f}\">{}</rect>",
      style, px_text(px(low.x)), px_text(py(high.y)), px_text(px(high.x) - px(low.x)),
      px_text(py(low.y) - py(high.y)), opacity, title(hint));
}

void Chart::level(double y, std::string_view style) {
  segment({x_.low, y}, {x_.high, y}, style);
}

void Chart::category(double x, std::string_view text) {
  fmt::format_to(std::back_inserter(body_), "<text class=\"tick mid\" x=\"{}\" y=\"{}\">{}</text>",
                 px_text(px(x)), px_text(height_ - bottom_px + 15), xml_escaped(text));
}

std::string Chart::str() const {
  return body_ + "</svg>";
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
  std::string out =
      fmt::format("<svg class=\"bars\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">", width,
                  row_px * static_cast<double>(rows.size()), xml_escaped(name));
  auto to = std::back_inserter(out);
  double y = 0;
  for (const BarRow& r : rows) {
    fmt::format_to(to, "<text class=\"row\" x=\"0\" y=\"{}\">{}</text>", px_text(y + 14),
                   xml_escaped(r.label));
    const double value = std::isfinite(r.value) ? r.value : 0;
    const double a = px(std::min(0.0, value)), b = px(std::max(0.0, value));
    fmt::format_to(to, "<rect class=\"{}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"15\">{}</rect>", r.style,
                   px_text(a), px_text(y + 21), px_text(std::max(1.0, b - a)), title(r.hint));
    double end = b;
    if (r.interval[1] > r.interval[0]) {
      fmt::format_to(to, "<line class=\"whisker\" x1=\"{}\" x2=\"{}\" y1=\"{}\" y2=\"{}\"/>",
                     px_text(px(r.interval[0])), px_text(px(r.interval[1])), px_text(y + 28.5),
                     px_text(y + 28.5));
      end = std::max(end, px(r.interval[1]));
    }
    if (std::isfinite(r.mark)) {
      fmt::format_to(to, "<line class=\"mark\" x1=\"{0}\" x2=\"{0}\" y1=\"{1}\" y2=\"{2}\"/>",
                     px_text(px(r.mark)), px_text(y + 18), px_text(y + 39));
      end = std::max(end, px(r.mark));
    }
    const std::string text = r.text.empty() ? brief(r.value) + std::string(unit) : r.text;
    fmt::format_to(to, "<text class=\"row\" x=\"{}\" y=\"{}\">{}</text>", px_text(end + 8), px_text(y + 33),
                   xml_escaped(text));
    y += row_px;
  }
  return out + "</svg>";
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
  std::string out = fmt::format("<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">", width,
                                height, xml_escaped(name));
  auto to = std::back_inserter(out);
  for (const double tick : ticks_of(low, high, 6)) {
    fmt::format_to(to, "<line class=\"{0}\" x1=\"{1}\" x2=\"{1}\" y1=\"4\" y2=\"{2}\"/>",
                   std::fabs(tick) < 1e-12 ? "zero" : "grid", px_text(px(tick)), px_text(height - 38));
    fmt::format_to(to, "<text class=\"tick mid\" x=\"{}\" y=\"{}\">{}</text>", px_text(px(tick)),
                   px_text(height - 24), brief(tick));
  }
  double y = 4;
  for (const ChangeRow& r : rows) {
    const double middle = y + row_px / 2;
    fmt::format_to(to, "<text class=\"tick end\" x=\"{}\" y=\"{}\">{}</text>", label - 8, px_text(middle + 4),
                   xml_escaped(r.label));
    fmt::format_to(to, "<line class=\"whisker\" x1=\"{}\" x2=\"{}\" y1=\"{}\" y2=\"{}\"/>",
                   px_text(px(r.before)), px_text(px(r.after)), px_text(middle), px_text(middle));
    for (const auto& [value, style] : {std::pair{r.before, "before"}, {r.after, "after"}}) {
      fmt::format_to(to, "<circle class=\"{}\" cx=\"{}\" cy=\"{}\" r=\"4.5\">{}</circle>", style,
                     px_text(px(value)), px_text(middle), title(r.label + ": " + brief(value)));
    }
    y += row_px;
  }
  fmt::format_to(to, "<text class=\"axis mid\" x=\"{}\" y=\"{}\">{}</text>", px_text((label + width) / 2),
                 px_text(height - 6), xml_escaped(axis));
  return out + "</svg>";
}

}  // namespace joulecast::gap
