#include "report/profile_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace joulecast::report {
namespace {

constexpr double width_px = 900, line_px = 19, head_px = 60, panel_px = 220;
// Of a panel, around its axes.
constexpr double left_px = 52, right_px = 12, top_px = 10, bottom_px = 40;

constexpr std::string_view style_sheet =
    "text{font-size:12px;fill:#222}.tick,.axis{fill:#6b7280}.mid{text-anchor:middle}.end{text-anchor:end}."
    "grid{stroke:#e5e7eb}.zero{stroke:#6b7280}polyline{fill:none;stroke-linejoin:round}.plan{stroke:#1d4ed8;"
    "stroke-width:2.4}.trapezoid{stroke:#d97706;stroke-width:1.8;stroke-dasharray:7 "
    "4}.triangle{stroke:#047857;stroke-width:2;stroke-dasharray:2 3}";

using Values = std::vector<double> DrawnMotion::*;

bool moves(const std::vector<double>& rates) {
  return std::ranges::any_of(rates, [](double rate) { return std::fabs(rate) > 1e-9; });
}

std::vector<std::pair<std::string_view, Values>> panels_of(std::span<const DrawnMotion> motions) {
  const bool drives = std::ranges::any_of(motions, moves, &DrawnMotion::speed_m_s);
  const bool turns = std::ranges::any_of(motions, moves, &DrawnMotion::yaw_rate_rad_s);
  std::vector<std::pair<std::string_view, Values>> panels;
  if (drives || !turns) panels.emplace_back("speed, m/s", &DrawnMotion::speed_m_s);
  if (turns) panels.emplace_back("yaw rate to the left, rad/s", &DrawnMotion::yaw_rate_rad_s);
  panels.emplace_back("power from the battery, W", &DrawnMotion::power_w);
  panels.emplace_back("energy from the battery, J", &DrawnMotion::energy_j);
  return panels;
}

// Two decimals of a pixel, without trailing zeros.
std::string px(double value) {
  std::string text = fmt::format("{:.2f}", value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

// Without control characters, which are not XML.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&' || c == '<' || c == '>')
      out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : "&gt;";
    else if (c == '"')
      out += "&quot;";
    else if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t')
      out += c;
  }
  return out;
}

std::string line(double x1, double y1, double x2, double y2, std::string_view css) {
  return fmt::format("<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" class=\"{}\"/>\n", px(x1), px(y1), px(x2),
                     px(y2), css);
}

std::string label(double x, double y, std::string_view css, std::string_view words) {
  return fmt::format("<text class=\"{}\" x=\"{}\" y=\"{}\">{}</text>\n", css, px(x), px(y), words);
}

// The values of the motions over time; a line is interrupted where a value is not finite.
std::string panel_of(std::string_view title, Values values, std::span<const DrawnMotion> motions,
                     double end_s, double panel_top) {
  double low = 0, high = 0;
  for (const DrawnMotion& m : motions)
    for (const double v : m.*values)
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  high += 0.04 * (high - low);
  if (!(high > low)) high = low + 1;
  if (!(end_s > 0)) end_s = 1;
  const double width = width_px - left_px - right_px, height = panel_px - top_px - bottom_px;
  const double top = panel_top + top_px, right = left_px + width, bottom = top + height;
  const auto x_of = [&](double time_s) { return left_px + time_s / end_s * width; };
  const auto y_of = [&](double v) { return top + (high - std::clamp(v, low, high)) / (high - low) * height; };
  std::string out;
  for (const double tick : ticks_of(low, high, 4))
    out += line(left_px, y_of(tick), right, y_of(tick), "grid") +
           label(left_px - 6, y_of(tick) + 3.5, "tick end", fmt::format("{:.7g}", tick));
  for (const double tick : ticks_of(0, end_s, static_cast<int>(width_px / 75)))
    out += label(x_of(tick), bottom + 15, "tick mid", fmt::format("{:.7g}", tick));
  out += label(left_px + width / 2, bottom + bottom_px - 6, "axis mid", "time, s");
  out += fmt::format("<text class=\"axis mid\" transform=\"translate({} {}) rotate(-90)\">{}</text>\n",
                     px(12), px(top + height / 2), title);
  out += line(left_px, y_of(0), right, y_of(0), "zero");
  for (std::size_t k = motions.size(); k-- > 0;) {
    std::string points;
    const auto end = [&] {
      if (!points.empty())
        out += fmt::format("<polyline points=\"{}\" class=\"{}\"/>\n", points, motions[k].style);
      points.clear();
    };
    for (std::size_t i = 0; i < motions[k].time_s.size(); ++i) {
      const double value = (motions[k].*values)[i];
      if (std::isfinite(value))
        points += fmt::format("{}{},{}", points.empty() ? "" : " ", px(x_of(motions[k].time_s[i])),
                              px(y_of(value)));
      else
        end();
    }
    end();
  }
  return out;
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
    ticks.push_back(k * step + 0.0);  // no negative zero
  return ticks;
}

std::string draw_profile(std::string_view heading, std::span<const DrawnMotion> motions) {
  const auto panels = panels_of(motions);
  double end_s = 0;
  for (const DrawnMotion& m : motions) end_s = std::max(end_s, m.time_s.back());
  double top = head_px + line_px * static_cast<double>(motions.size());
  const std::string height = px(top + panel_px * static_cast<double>(panels.size()));
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\">\n<title>motion over time</title>\n"
      "<style>{2}</style>\n<rect x=\"0\" y=\"0\" width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n"
      "<text x=\"{3}\" y=\"28\" font-size=\"17\" fill=\"#222\" font-weight=\"bold\">{4}</text>\n",
      px(width_px), height, style_sheet, px(left_px), escaped(heading));
  double y = 50;
  for (const DrawnMotion& m : motions) {
    out += line(left_px, y - 4, left_px + 34, y - 4, m.style);
    out += fmt::format("<text x=\"{}\" y=\"{}\" font-size=\"13\" fill=\"#222\">{}</text>\n", px(left_px + 42),
                       px(y), escaped(m.label));
    y += line_px;
  }
  for (const auto& [title, values] : panels) {
    out += panel_of(title, values, motions, end_s, top);
    top += panel_px;
  }
  return out + "</svg>\n";
}

}  // namespace joulecast::report
