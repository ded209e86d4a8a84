#include "report/profile_drawing.h"

#include <algorithm>
#include <cmath>

#include "report/chart.h"

namespace joulecast::report {
namespace {

constexpr double width_px = 900, profile_left_px = 52, line_px = 19, head_px = 60, profile_panel_px = 220;

constexpr std::string_view style_sheet =
    "text{font-size:12px;fill:#222}.tick,.axis{fill:#6b7280}.mid{text-anchor:middle}.end{text-anchor:end}."
    "grid{stroke:#e5e7eb}.zero{stroke:#6b7280}polyline{fill:none;stroke-linejoin:round}.plan{stroke:#1d4ed8;"
    "stroke-width:2.4}.trapezoid{stroke:#d97706;stroke-width:1.8;stroke-dasharray:7 "
    "4}.triangle{stroke:#047857;stroke-width:2;stroke-dasharray:2 3}";

struct Panel {
  std::string_view title;
  std::vector<double> DrawnMotion::*values;
};

bool moves(const std::vector<double>& rates) {
  return std::ranges::any_of(rates, [](double rate) { return std::fabs(rate) > 1e-9; });
}

std::vector<Panel> panels_of(std::span<const DrawnMotion> motions) {
  const bool drives = std::ranges::any_of(motions, moves, &DrawnMotion::speed_m_s);
  const bool turns = std::ranges::any_of(motions, moves, &DrawnMotion::yaw_rate_rad_s);
  std::vector<Panel> panels;
  if (drives || !turns) panels.push_back({"speed, m/s", &DrawnMotion::speed_m_s});
  if (turns) panels.push_back({"yaw rate to the left, rad/s", &DrawnMotion::yaw_rate_rad_s});
  panels.push_back({"power from the battery, W", &DrawnMotion::power_w});
  panels.push_back({"energy from the battery, J", &DrawnMotion::energy_j});
  return panels;
}

void draw_panel(Svg& svg, const Panel& panel, std::span<const DrawnMotion> motions, double end_s,
                double top) {
  double low = 0, high = 0;
  for (const DrawnMotion& m : motions)
    for (const double v : m.*panel.values)
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  Chart chart(svg, {0, top, width_px, profile_panel_px}, {0, end_s, "time, s"},
              {low, high + 0.04 * (high - low), std::string(panel.title)});
  chart.level(0, "zero");
  for (std::size_t k = motions.size(); k-- > 0;) {
    std::vector<SvgPoint> points;
    for (std::size_t i = 0; i < motions[k].time_s.size(); ++i)
      points.push_back({motions[k].time_s[i], (motions[k].*panel.values)[i]});
    chart.line(points, motions[k].style);
  }
}

}  // namespace

std::string draw_profile(std::string_view heading, std::span<const DrawnMotion> motions) {
  const std::vector<Panel> panels = panels_of(motions);
  double end_s = 0;
  for (const DrawnMotion& m : motions) end_s = std::max(end_s, m.time_s.back());
  const double head = head_px + line_px * static_cast<double>(motions.size());
  Svg svg = Svg::document(width_px, head + profile_panel_px * static_cast<double>(panels.size()),
                          "motion over time", style_sheet);
  svg.text({profile_left_px, 28}, heading, {.size = 17, .bold = true});
  double y = 50;
  for (const DrawnMotion& m : motions) {
    svg.line({profile_left_px, y - 4}, {profile_left_px + 34, y - 4}, {.css = m.style});
    svg.text({profile_left_px + 42, y}, m.label, {.size = 13});
    y += line_px;
  }
  double top = head;
  for (const Panel& panel : panels) {
    draw_panel(svg, panel, motions, end_s, top);
    top += profile_panel_px;
  }
  return svg.str();
}

}  // namespace joulecast::report
