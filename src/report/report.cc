#include "report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "base/json_number.h"
#include "robot/robot_file.h"

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

using Json = nlohmann::json;

struct Motion {
  std::string label;
  std::string_view style;  // plan, trapezoid or triangle
  std::map<std::string_view, std::vector<double>> columns = {};
};

// Empty unless the columns of a profile have the same length.
std::optional<Motion> motion_of(const Json& holder, std::string label, std::string_view style) {
  Motion motion{std::move(label), style};
  if (!holder.is_object() || !holder.contains("profile") || !holder["profile"].is_object())
    return std::nullopt;
  for (const char* name : {"time_s", "speed_m_s", "yaw_rate_rad_s", "power_w", "energy_j"}) {
    std::vector<double>& column = motion.columns[name];
    for (const Json& value : holder["profile"].value(name, Json::array()))
      column.push_back(number_or_nan(value));
    if (column.size() < 2 || column.size() != motion.columns["time_s"].size()) return std::nullopt;
  }
  return motion;
}

struct Panel {
  std::string_view column, title;
};

// Speed where a motion drives, yaw rate where one turns, power and energy.
std::vector<Panel> panels_of(std::span<const Motion> motions) {
  const auto moves = [&](std::string_view rate) {
    return std::ranges::any_of(motions, [&](const Motion& motion) {
      return std::ranges::any_of(motion.columns.at(rate), [](double v) { return std::fabs(v) > 1e-9; });
    });
  };
  const bool turns = moves("yaw_rate_rad_s");
  std::vector<Panel> panels;
  if (!turns || moves("speed_m_s")) panels.push_back({"speed_m_s", "speed, m/s"});
  if (turns) panels.push_back({"yaw_rate_rad_s", "yaw rate to the left, rad/s"});
  panels.push_back({"power_w", "power from the battery, W"});
  panels.push_back({"energy_j", "energy from the battery, J"});
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
std::string drawn_panel(const Panel& panel, std::span<const Motion> motions, double end_s, double panel_top) {
  double low = 0, high = 0;
  for (const Motion& m : motions)
    for (const double v : m.columns.at(panel.column))
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
                     px(12), px(top + height / 2), panel.title);
  out += line(left_px, y_of(0), right, y_of(0), "zero");
  for (std::size_t k = motions.size(); k-- > 0;) {
    std::string points;
    const auto end = [&] {
      if (!points.empty())
        out += fmt::format("<polyline points=\"{}\" class=\"{}\"/>\n", points, motions[k].style);
      points.clear();
    };
    const std::vector<double>&times = motions[k].columns.at("time_s"),
          &values = motions[k].columns.at(panel.column);
    for (std::size_t i = 0; i < times.size(); ++i) {
      if (std::isfinite(values[i]))
        points += fmt::format("{}{},{}", points.empty() ? "" : " ", px(x_of(times[i])), px(y_of(values[i])));
      else
        end();
    }
    end();
  }
  return out;
}

std::string draw(std::string_view heading, std::span<const Motion> motions) {
  double end_s = 0;
  for (const Motion& m : motions) end_s = std::max(end_s, m.columns.at("time_s").back());
  double top = head_px + line_px * static_cast<double>(motions.size());
  const std::vector<Panel> panels = panels_of(motions);
  const std::string height = px(top + panel_px * static_cast<double>(panels.size()));
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\">\n<title>motion over time</title>\n"
      "<style>{2}</style>\n<rect x=\"0\" y=\"0\" width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n"
      "<text x=\"{3}\" y=\"28\" font-size=\"17\" fill=\"#222\" font-weight=\"bold\">{4}</text>\n",
      px(width_px), height, style_sheet, px(left_px), escaped(heading));
  double y = 50;
  for (const Motion& m : motions) {
    out += line(left_px, y - 4, left_px + 34, y - 4, m.style);
    out += fmt::format("<text x=\"{}\" y=\"{}\" font-size=\"13\" fill=\"#222\">{}</text>\n", px(left_px + 42),
                       px(y), escaped(m.label));
    y += line_px;
  }
  for (const Panel& panel : panels) {
    out += drawn_panel(panel, motions, end_s, top);
    top += panel_px;
  }
  return out + "</svg>\n";
}

std::string baseline_label(const char* name, const Json& baseline) {
  return fmt::format("{}, as long on every run: {:.1f} J; the plan saves {:.1f} %{}", name,
                     number_at(baseline, "energy_j"), 100 * number_at(baseline, "saving_fraction"),
                     baseline.value("within_limits", true) ? "" : " (breaks the robot's limits)");
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

Result<std::string> draw_answer(const Json& answer) {
  const auto baselines = answer.find("baselines");
  const bool planned = baselines != answer.end() && baselines->is_object();
  auto own = motion_of(
      answer, fmt::format("{}: {:.1f} J", planned ? "least energy" : "motion", number_at(answer, "energy_j")),
      "plan");
  if (!own) return fail(Fault::corrupt, "profile", "the answer has no columns to draw");
  std::vector<Motion> motions{std::move(*own)};
  for (const char* name : {"trapezoid", "triangle"}) {
    if (!planned || !baselines->value(name, Json()).is_object()) continue;
    const Json& baseline = (*baselines)[name];
    if (auto motion = motion_of(baseline, baseline_label(name, baseline), name))
      motions.push_back(std::move(*motion));
  }
  return draw(fmt::format("{}: {:.2f} m, {:.2f} rad turned, {:.2f} s",
                          answer.value("robot_id", std::string("robot")), number_at(answer, "distance_m"),
                          number_at(answer, "turned_rad"), number_at(answer, "duration_s")),
              motions);
}

extern const std::string_view report_template;  // server/web/report.template, embedded at build

std::string report_html(const nlohmann::ordered_json& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin) {
  using Json = nlohmann::ordered_json;
  const Json data = {{"result", diagnosis},
                     {"robot", robot::robot_to_json(robot)},
                     {"origin",
                      {{"sources", origin.sources},
                       {"model", origin.model},
                       {"made_at", origin.made_at},
                       {"software", origin.software}}}};
  std::string text = data.dump(-1, ' ', false, Json::error_handler_t::replace);
  // No tag begins within the data. In JSON, < is in strings only.
  for (auto at = text.find('<'); at != std::string::npos; at = text.find('<', at))
    text.replace(at, 1, "\\u003c");
  constexpr std::string_view mark = "@DATA@";
  std::string html(report_template);
  return html.replace(html.find(mark), mark.size(), text);
}

}  // namespace joulecast::report
