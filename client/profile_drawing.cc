#include "client/profile_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "client/svg.h"

namespace joulecast::client {
namespace {

using nlohmann::json;

constexpr double width_px = 900, left_px = 74, right_px = 24, head_px = 112, panel_px = 168, gap_px = 34,
                 foot_px = 46;
constexpr std::string_view ink = "#222", faint = "#6b7280", grid = "#e5e7eb";

struct Look {
  std::string_view colour, dash;
  double width;
};
constexpr Look plan_look{"#1d4ed8", "", 2.4}, trapezoid_look{"#d97706", "7 4", 1.8},
    triangle_look{"#047857", "2 3", 2.0};

struct Series {
  std::string label;
  Look look;
  std::vector<double> time_s, speed_m_s, yaw_rate_rad_s, power_w, energy_j;
};

std::vector<double> column(const json& object, const char* name) {
  std::vector<double> values;
  const auto found = object.find(name);
  if (found == object.end() || !found->is_array()) return values;
  for (const json& value : *found) values.push_back(value.is_number() ? value.get<double>() : std::nan(""));
  return values;
}

std::optional<Series> series_of(const json& holder, std::string label, const Look& look) {
  if (!holder.is_object()) return std::nullopt;
  const auto found = holder.find("profile");
  if (found == holder.end() || !found->is_object()) return std::nullopt;
  Series s{std::move(label),
           look,
           column(*found, "time_s"),
           column(*found, "speed_m_s"),
           column(*found, "yaw_rate_rad_s"),
           column(*found, "power_w"),
           column(*found, "energy_j")};
  const std::size_t n = s.time_s.size();
  if (n < 2 || s.speed_m_s.size() != n || s.yaw_rate_rad_s.size() != n || s.power_w.size() != n ||
      s.energy_j.size() != n)
    return std::nullopt;
  return s;
}

double number(const json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() && found->is_number() ? found->get<double>() : std::nan("");
}

// A range widened to round steps: about `count` of 1, 2 or 5 times a power of ten.
struct Scale {
  double low = 0, high = 1, step = 1;

  Scale(double from, double to, int count, bool widen) {
    if (!(to > from)) to = from + 1;
    const double rough = (to - from) / count, power = std::pow(10, std::floor(std::log10(rough)));
    const double share = rough / power;
    step = power * (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10);
    low = widen ? step * std::floor(from / step + 1e-9) : from;
    high = widen ? step * std::ceil(to / step - 1e-9) : to;
  }
  double share(double value) const { return (value - low) / (high - low); }
  std::string label(double value) const {
    const int places = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
    return fmt::format("{:.{}f}", std::fabs(value) < 1e-9 * step ? 0.0 : value, places);
  }
};

struct Panel {
  std::string_view title;
  std::vector<double> Series::*values;
};

void draw_panel(Svg& svg, const Panel& panel, const std::vector<Series>& all, const Scale& time, double top) {
  const double wide = width_px - left_px - right_px, bottom = top + panel_px;
  double low = 0, high = 0;
  for (const Series& s : all)
    for (const double v : s.*panel.values)
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  const Scale scale(low, high, 4, true);
  const auto x = [&](double t) { return left_px + wide * time.share(t); };
  const auto y = [&](double v) { return bottom - panel_px * scale.share(v); };
  svg.text({left_px, top - 9}, panel.title, {.size = 13, .fill = ink, .bold = true});
  for (double v = scale.low; v <= scale.high + 1e-9 * scale.step; v += scale.step) {
    const bool zero = std::fabs(v) < 1e-9 * scale.step;
    svg.line({left_px, y(v)}, {width_px - right_px, y(v)}, {.stroke = zero ? faint : grid});
    svg.text({left_px - 8, y(v) + 4}, scale.label(v), {.size = 12, .fill = faint, .anchor = SvgAnchor::end});
  }
  for (double t = 0; t <= time.high + 1e-9; t += time.step)
    svg.line({x(t), top}, {x(t), bottom}, {.stroke = grid});
  // The plan last, on top.
  for (std::size_t k = all.size(); k-- > 0;) {
    const Series& s = all[k];
    std::vector<SvgPoint> points;
    for (std::size_t i = 0; i < s.time_s.size(); ++i)
      if (std::isfinite((s.*panel.values)[i])) points.push_back({x(s.time_s[i]), y((s.*panel.values)[i])});
    svg.polyline(points, {.stroke = s.look.colour, .width = s.look.width, .dash = s.look.dash});
  }
}

void draw_head(Svg& svg, const json& answer, const std::vector<Series>& all) {
  const std::string robot = answer.value("robot_id", std::string("robot"));
  svg.text({left_px, 28},
           fmt::format("{}: {:.2f} m, {:.2f} rad turned, {:.2f} s", robot, number(answer, "distance_m"),
                       number(answer, "turned_rad"), number(answer, "duration_s")),
           {.size = 17, .fill = ink, .bold = true});
  double y = 50;
  for (const Series& s : all) {
    svg.line({left_px, y - 4}, {left_px + 34, y - 4},
             {.stroke = s.look.colour, .width = s.look.width, .dash = s.look.dash});
    svg.text({left_px + 42, y}, s.label, {.size = 13, .fill = ink});
    y += 19;
  }
}

std::string baseline_label(const char* name, const json& baseline) {
  return fmt::format("{}, as long on every run: {:.1f} J; the plan saves {:.1f} %{}", name,
                     number(baseline, "energy_j"), 100 * number(baseline, "saving_fraction"),
                     baseline.value("within_limits", true) ? "" : " (breaks the robot's limits)");
}

}  // namespace

Result<std::string> draw_profile(const json& answer) {
  std::vector<Series> all;
  const auto baselines = answer.find("baselines");
  const bool planned = baselines != answer.end() && baselines->is_object();
  auto own = series_of(
      answer, fmt::format("{}: {:.1f} J", planned ? "least energy" : "motion", number(answer, "energy_j")),
      plan_look);
  if (!own) return fail(Fault::corrupt, "profile", "the answer has no columns to draw");
  all.push_back(std::move(*own));
  if (planned) {
    for (const auto& [name, look] : {std::pair{"trapezoid", trapezoid_look}, {"triangle", triangle_look}}) {
      const auto found = baselines->find(name);
      if (found == baselines->end() || !found->is_object()) continue;
      if (auto series = series_of(*found, baseline_label(name, *found), look))
        all.push_back(std::move(*series));
    }
  }
  std::vector<Panel> panels{{"speed [m/s]", &Series::speed_m_s}};
  bool drives = false, turns = false;
  double end_s = 0;
  for (const Series& s : all) {
    drives = drives || std::any_of(s.speed_m_s.begin(), s.speed_m_s.end(),
                                   [](double v) { return std::fabs(v) > 1e-9; });
    turns = turns || std::any_of(s.yaw_rate_rad_s.begin(), s.yaw_rate_rad_s.end(),
                                 [](double w) { return std::fabs(w) > 1e-9; });
    end_s = std::max(end_s, s.time_s.back());
  }
  if (!drives && turns) panels.clear();
  if (turns) panels.push_back({"yaw rate [rad/s], to the left positive", &Series::yaw_rate_rad_s});
  panels.push_back({"power from the battery [W]", &Series::power_w});
  panels.push_back({"energy from the battery [J]", &Series::energy_j});

  const double height = head_px + static_cast<double>(panels.size()) * (panel_px + gap_px) - gap_px + foot_px;
  Svg svg(width_px, height, "motion of least energy over time");
  svg.rect(0, 0, width_px, height, {.fill = "#ffffff"});
  draw_head(svg, answer, all);
  const Scale time(0, end_s, 8, false);
  double top = head_px + 8;
  for (const Panel& panel : panels) {
    draw_panel(svg, panel, all, time, top);
    top += panel_px + gap_px;
  }
  const double bottom = top - gap_px;
  for (double t = 0; t <= time.high + 1e-9; t += time.step) {
    const double x = left_px + (width_px - left_px - right_px) * time.share(t);
    svg.text({x, bottom + 17}, time.label(t), {.size = 12, .fill = faint, .anchor = SvgAnchor::middle});
  }
  svg.text({width_px - right_px, bottom + 33}, "time [s]",
           {.size = 12, .fill = ink, .anchor = SvgAnchor::end});
  return svg.str();
}

}  // namespace joulecast::client
