#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/xml_text.h"
#include "gap/verdict/words.h"
#include "report/chart.h"
#include "report/quantity.h"
#include "report/sections.h"

namespace joulecast::report {

using namespace gap;

namespace {

using Entries = std::vector<std::pair<std::string, std::string>>;

Entries legend_of(bool with_effects) {
  Entries legend{{"before", "model as it is"}};
  if (with_effects) legend.emplace_back("after", "with the effects found");
  return legend;
}

std::string chart_of(const Figures::Map& map, bool with_effects) {
  double low = 0, high = 0;
  for (const Figures::Bin& b : map.bins) {
    const double half = std::isfinite(b.half_width_w) ? b.half_width_w : 0;
    low = std::min({low, b.before_w - half, with_effects ? b.after_w : 0});
    high = std::max({high, b.before_w + half, with_effects ? b.after_w : 0});
  }
  const double margin = 0.06 * std::max(high - low, 1e-9);
  const bool named = !map.bins.front().label.empty();
  const std::string_view degrees =
      map.axis.find("rad/s") == std::string::npos ? std::string_view() : degrees_of("rad/s");
  Svg svg = Svg::part(420, 230, "error of the modelled power over " + map.axis);
  Chart chart(svg, {0, 0, 420, 230}, {map.bins.front().from, map.bins.back().to, map.axis, !named, degrees},
              {low < 0 ? low - margin : low, high + margin, "missed power, W"});
  chart.level(0, "zero");
  for (const Figures::Bin& b : map.bins) {
    const double width = b.to - b.from, middle = b.from + 0.5 * width, edge = 0.08 * width;
    if (named) chart.category(middle, b.label);
    if (b.before_w == 0 && b.after_w == 0) continue;  // too few windows
    const double before_to = with_effects ? middle : b.to - edge;
    const std::string then = with_effects ? fmt::format(" before, {} W after", brief(b.after_w)) : "";
    const std::string hint =
        fmt::format("{} W{}, {}", brief(b.before_w), then, count_text(b.windows, "window"));
    chart.bar(b.from + edge, before_to, 0, b.before_w, "before", hint);
    if (with_effects) chart.bar(middle, b.to - edge, 0, b.after_w, "after", hint);
    if (!std::isfinite(b.half_width_w)) continue;
    const double at = 0.5 * (b.from + edge + before_to);
    chart.segment({at, b.before_w - b.half_width_w}, {at, b.before_w + b.half_width_w}, "whisker");
  }
  return svg.str();
}

void regions_table(Page& page, std::span<const WhereRegion> where) {
  if (where.empty()) {
    page.paragraph("No region is conspicuous once the number of regions looked at is allowed for.");
    return;
  }
  page.paragraph(
      "Conspicuous regions, worst first; their shares overlap, since each looks at all of the data by one "
      "variable:");
  std::vector<std::vector<std::string>> rows;
  for (const WhereRegion& w : where) {
    const std::string_view unit = unit_of(w.variable);
    rows.push_back({xml_escaped(words_of(w.channel)), xml_escaped(words_of(without_unit(w.variable))),
                    xml_escaped(w.label.empty() ? quantity_range(w.from, w.to, unit) : w.label),
                    share_text(w.share, w.interval), share_text(w.time_share)});
  }
  const std::vector<std::string> header{"Shows in", "by", "range", "share of the gap [95 %]", "of the time"};
  page.table(header, rows, 3);
}

// Of the floor's cells.
struct Extent {
  double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
  double strong_w = 0;  // nearly all cells are below it

  explicit Extent(const Figures& f) {
    std::vector<double> sizes;
    for (const Figures::Cell& c : f.floor) {
      x0 = std::min(x0, c.x_m), x1 = std::max(x1, c.x_m + f.cell_m);
      y0 = std::min(y0, c.y_m), y1 = std::max(y1, c.y_m + f.cell_m);
      sizes.push_back(std::fabs(c.before_w));
    }
    std::ranges::sort(sizes);
    if (!sizes.empty()) strong_w = sizes[sizes.size() * 95 / 100];
  }
};

std::string floor_chart(const Figures& f, const Extent& e, bool after) {
  constexpr double plot = 380, beside = 64, below = 50;  // of the picture's longer side, and for its axes
  const double scale = plot / std::max(e.x1 - e.x0, e.y1 - e.y0);
  const double width = (e.x1 - e.x0) * scale + beside, height = (e.y1 - e.y0) * scale + below;
  Svg svg = Svg::part(width, height, after ? "floor map, with the effects" : "floor map, model as it is");
  Chart chart(svg, {0, 0, width, height}, {e.x0, e.x1, "x, m"}, {e.y0, e.y1, "y, m"});
  for (const Figures::Cell& c : f.floor) {
    const double value = after ? c.after_w : c.before_w;
    chart.cell({c.x_m, c.y_m}, {c.x_m + f.cell_m, c.y_m + f.cell_m}, value > 0 ? "more" : "less",
               0.06 + 0.94 * std::min(1.0, std::fabs(value) / std::max(e.strong_w, 1e-9)),
               fmt::format("{} W missed, {}", brief(value), count_text(c.windows, "window")));
  }
  return svg.str();
}

std::string utc(std::int64_t utime_us) {
  return fmt::format("{:%Y-%m-%d %H:%M}", fmt::gmtime(static_cast<std::time_t>(utime_us / 1'000'000)));
}

}  // namespace

void where_section(Page& page, const Diagnosis& d) {
  if (d.figures.maps.empty() && d.where.empty()) return;
  const bool with_effects = !d.effects.empty();
  page.section(
      "Errors by operating condition",
      "Mean of measured less modelled power in ranges of one variable each. Above zero the robot "
      "consumes more than the model. Whiskers: 95 % intervals of the model as it is, by blocks of time.");
  Entries charts;
  for (const Figures::Map& map : d.figures.maps) {
    if (!map.bins.empty()) charts.emplace_back(chart_of(map, with_effects), "");
  }
  if (!charts.empty()) {
    page.legend(legend_of(with_effects));
    page.charts(charts);
  }
  regions_table(page, d.where);
}

void floor_section(Page& page, const Diagnosis& d) {
  constexpr std::size_t fewest_cells = 4;
  if (d.figures.floor.size() < fewest_cells) return;
  const Extent extent(d.figures);
  page.section("Where on the floor",
               fmt::format("Mean missed power where the robot drove; full colour is {} W.",
                           brief(extent.strong_w, 2)));
  page.legend(Entries{{"more", "more than the model"}, {"less", "less than the model"}});
  Entries pictures{{floor_chart(d.figures, extent, false), "Model as it is"}};
  if (!d.effects.empty())
    pictures.emplace_back(floor_chart(d.figures, extent, true), "With the effects found");
  page.charts(pictures);
}

void power_section(Page& page, const Diagnosis& d) {
  constexpr std::size_t fewest_points = 5;
  const std::vector<Figures::Point>& points = d.figures.power;
  if (points.size() < fewest_points) return;
  std::vector<SvgPoint> measured, before, after;
  double low = 0, high = 0;
  for (const Figures::Point& p : points) {
    measured.push_back({p.t_s, p.measured_w});
    before.push_back({p.t_s, p.before_w});
    after.push_back({p.t_s, p.after_w});
    for (const double w : {p.measured_w, p.before_w, p.after_w}) {
      if (std::isfinite(w)) low = std::min(low, w), high = std::max(high, w);
    }
  }
  page.section("Power over time", "The part of mission " + d.figures.stretch_of + " with the largest gap.");
  Entries legend = legend_of(!d.effects.empty());
  legend.insert(legend.begin(), {"measured", "measured"});
  page.legend(legend);
  Svg svg = Svg::part(820, 300, "measured and modelled power");
  Chart chart(svg, {0, 0, 820, 300},
              {points.front().t_s, points.back().t_s, "time since the mission began, s"},
              {low, high * 1.05,
               d.power == PowerSource::battery ? "battery power, W" : "motor power with idle power, W"});
  chart.level(0, "zero");
  chart.line(before, "before");
  if (!d.effects.empty()) chart.line(after, "after");
  chart.line(measured, "measured");
  page.wide_chart(svg.str());
}

void missions_section(Page& page, const Diagnosis& d) {
  page.section("Missions");
  page.paragraph(
      fmt::format("{} with {}.", count_text(d.missions, "mission"), count_text(d.samples, "sample")));
  if (!d.notes.empty()) page.list(d.notes);
  if (d.figures.missions.empty()) return;
  const bool with_effects = !d.effects.empty();
  std::vector<std::vector<std::string>> rows;
  for (const Figures::Mission& m : d.figures.missions) {
    rows.push_back({xml_escaped(m.mission_id), utc(m.start_utime_us), brief(m.length_s), brief(m.payload_kg),
                    share_text(m.energy_before)});
    if (with_effects) rows.back().push_back(share_text(m.energy_after));
    rows.back().push_back(share_text(m.power_before));
    if (with_effects) rows.back().push_back(share_text(m.power_after));
  }
  std::vector<std::string> header{"Mission", "began (UTC)", "s", "payload kg", "energy missed"};
  if (with_effects) header.emplace_back("with effects");
  header.emplace_back("power missed");
  if (with_effects) header.emplace_back("with effects");
  page.table(header, rows, 2);
  page.paragraph(with_effects
                     ? "Missed energy and power by mission; with effects: as found in all of these missions."
                     : "Missed energy and power by mission.");
  if (d.missions > rows.size())
    page.paragraph(fmt::format("The first {} of {} missions.", rows.size(), d.missions));
}

}  // namespace joulecast::report
