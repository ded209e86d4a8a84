#include "tests/study/exploration/exploration_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numbers>
#include <vector>

#include "report/report.h"
#include "tests/study/exploration/svg.h"

namespace joulecast::report {
namespace {

using namespace exploration;

constexpr std::string_view unseen_colour = "#8d9299";
constexpr std::string_view occupied_colour = "#d8c3a0";
constexpr std::string_view obstacle_colour = "#3f6fa8";
constexpr std::string_view outline_colour = "#d62728";
constexpr std::string_view path_colour = "#111";
constexpr std::string_view robot_colour = "#d62728";
constexpr std::string_view best_colour = "#e8820c";
// Darker the later a node was seen.
constexpr std::array<std::string_view, 5> seen_colours{"#e3f4dc", "#bfe3b4", "#94cf8a", "#66b765", "#3f9a4e"};

constexpr double margin_px = 24;
constexpr double main_px = 640;    // the longer side of the large map
constexpr double panel_px = 236;   // of a small one
constexpr double column_px = 430;  // steps, legend and energy
constexpr std::size_t panels_a_row = 4;
constexpr double row_px = 19;

std::string_view seen_colour(std::size_t round) {
  return seen_colours[std::min(round, seen_colours.size()) - 1];
}

// One map within the picture.
struct Frame {
  const Map& map;
  double left, top, scale;  // px, px, px/m

  Frame(const Map& m, double x, double y, double longer_side_px)
      : map(m), left(x), top(y), scale(longer_side_px / std::max(m.width_m, m.height_m)) {}

  double width() const { return map.width_m * scale; }
  double height() const { return map.height_m * scale; }
  SvgPoint at(Point p) const { return {left + p.x_m * scale, top + (map.height_m - p.y_m) * scale}; }
};

void draw_ground(Svg& svg, const Frame& frame, const Exploration& e, std::size_t until_round) {
  svg.begin_clip(frame.left, frame.top, frame.width(), frame.height());
  const double cell = frame.map.node_spacing_m;
  const auto colour = [&](std::size_t node) {
    if (e.nodes[node] == NodeState::occupied) return occupied_colour;
    const std::size_t round = e.seen_in[node];
    return round == 0 || round > until_round ? unseen_colour : seen_colour(round);
  };
  for (std::size_t row = 0; row < e.nodes.size(); row += e.columns) {
    for (std::size_t first = row; first < row + e.columns;) {
      std::size_t last = first;
      while (last + 1 < row + e.columns && colour(last + 1) == colour(first)) ++last;
      const auto column = static_cast<double>(first - row), count = static_cast<double>(last - first + 1);
      const SvgPoint corner = frame.at(
          {(column - 0.5) * cell, (static_cast<double>(row) / static_cast<double>(e.columns) + 0.5) * cell});
      // A pixel of overlap hides the seams between cells.
      svg.rect(corner.x, corner.y, count * cell * frame.scale + 1, cell * frame.scale + 1,
               {.fill = colour(first)});
      first = last + 1;
    }
  }
  const auto outline = [&](const ConvexPolygon& shape, const SvgStyle& style) {
    std::vector<SvgPoint> points;
    for (const Point& c : shape.corners()) points.push_back(frame.at(c));
    svg.polygon(points, style);
  };
  for (const ConvexPolygon& o : frame.map.obstacles)
    outline(o.grown(frame.map.safety_radius_m), {.fill = occupied_colour});
  for (const ConvexPolygon& o : frame.map.obstacles) outline(o, {.fill = obstacle_colour});
  for (const ConvexPolygon& o : frame.map.obstacles)
    outline(o.grown(frame.map.safety_radius_m),
            {.stroke = outline_colour, .width = 1.2, .dash = "5 3", .opacity = 0.9});
  svg.end_clip();
  svg.rect(frame.left, frame.top, frame.width(), frame.height(), {.stroke = "#333", .width = 1});
}

void draw_axes(Svg& svg, const Frame& frame) {
  const double longer = std::max(frame.map.width_m, frame.map.height_m);
  for (const double v : ticks_of(0, longer, 6)) {
    if (v <= frame.map.width_m * (1 + 1e-9)) {
      const SvgPoint p = frame.at({v, 0});
      svg.line(p, {p.x, p.y + 4}, {.stroke = "#333"});
      svg.text({p.x, p.y + 16}, fmt::format("{:g}", v), {.size = 11, .anchor = SvgAnchor::middle});
    }
    if (v <= frame.map.height_m * (1 + 1e-9)) {
      const SvgPoint p = frame.at({0, v});
      svg.line(p, {p.x - 4, p.y}, {.stroke = "#333"});
      svg.text({p.x - 7, p.y + 4}, fmt::format("{:g}", v), {.size = 11, .anchor = SvgAnchor::end});
    }
  }
  svg.text({frame.left + frame.width() / 2, frame.top + frame.height() + 31}, "x [m]",
           {.size = 11, .anchor = SvgAnchor::middle});
  svg.text({frame.left - 24, frame.top - 8}, "y [m]", {.size = 11});
}

void draw_arrow(Svg& svg, SvgPoint tip, double dx, double dy, double size, std::string_view colour) {
  const std::array<SvgPoint, 3> head{
      {{tip.x, tip.y},
       {tip.x - size * dx - 0.45 * size * dy, tip.y - size * dy + 0.45 * size * dx},
       {tip.x - size * dx + 0.45 * size * dy, tip.y - size * dy - 0.45 * size * dx}}};
  svg.polygon(head, {.fill = colour});
}

// A straight leg with its direction in the middle.
void draw_leg(Svg& svg, const Frame& frame, Point from, Point to, double width) {
  const SvgPoint a = frame.at(from), b = frame.at(to);
  svg.line(a, b, {.stroke = "#fff", .width = width + 2, .opacity = 0.7});
  svg.line(a, b, {.stroke = path_colour, .width = width});
  const double size = std::hypot(b.x - a.x, b.y - a.y);
  if (size < 16) return;
  const double dx = (b.x - a.x) / size, dy = (b.y - a.y) / size, head = 4 + 3 * width;
  draw_arrow(svg, {(a.x + b.x) / 2 + dx * head / 2, (a.y + b.y) / 2 + dy * head / 2}, dx, dy, head,
             path_colour);
}

// Where the robot looked from: a number in a disc, and a stub for the heading on arrival.
void draw_look(Svg& svg, const Frame& frame, const Scan& scan, std::size_t number, double radius) {
  const SvgPoint at = frame.at(scan.at);
  const double dx = std::cos(scan.heading_rad), dy = -std::sin(scan.heading_rad);
  svg.line(at, {at.x + 1.6 * radius * dx, at.y + 1.6 * radius * dy}, {.stroke = robot_colour, .width = 3});
  draw_arrow(svg, {at.x + 2.3 * radius * dx, at.y + 2.3 * radius * dy}, dx, dy, radius * 0.9, robot_colour);
  svg.circle(at, radius, {.fill = "#fff", .stroke = robot_colour, .width = 2});
  svg.text({at.x, at.y + radius * 0.42}, fmt::format("{}", number),
           {.size = radius * 1.2, .fill = robot_colour, .anchor = SvgAnchor::middle, .bold = true});
}

void draw_whole(Svg& svg, const Frame& frame, const Exploration& e) {
  draw_ground(svg, frame, e, e.rounds.size());
  draw_axes(svg, frame);
  for (const Motion& motion : e.motions)
    if (const auto* leg = std::get_if<Straight>(&motion)) draw_leg(svg, frame, leg->from, leg->to, 2.2);
  for (const Round& round : e.rounds) {
    if (!round.next) continue;
    for (std::size_t k = 0; k + 1 < round.next->path.size(); ++k)
      svg.circle(frame.at(round.next->path[k]), 4.5, {.fill = "#fff", .stroke = path_colour, .width = 2});
  }
  for (std::size_t k = 0; k < e.rounds.size(); ++k) draw_look(svg, frame, e.rounds[k].scan, k + 1, 12);
}

void draw_cross(Svg& svg, SvgPoint at, double size) {
  const SvgStyle style{.stroke = "#b00020", .width = 1.6};
  svg.line({at.x - size, at.y - size}, {at.x + size, at.y + size}, style);
  svg.line({at.x - size, at.y + size}, {at.x + size, at.y - size}, style);
}

// The robot's map after one look, the candidates for the next, and the way there.
void draw_round(Svg& svg, const Frame& frame, const Exploration& e, std::size_t index) {
  const Round& round = e.rounds[index];
  draw_ground(svg, frame, e, index + 1);
  if (round.next) {
    const NextBestView& view = *round.next;
    svg.begin_clip(frame.left, frame.top, frame.width(), frame.height());
    if (!view.from_frontier)
      for (const ViewCircle& c : view.circles)
        svg.circle(frame.at(c.center), c.radius_m * frame.scale,
                   {.stroke = "#5b2c83", .width = 1, .dash = "3 3", .opacity = 0.8});
    svg.end_clip();
    Point from = round.scan.at;
    for (const Point& p : view.path) draw_leg(svg, frame, std::exchange(from, p), p, 1.4);
    for (std::size_t k = 0; k < view.candidates.size(); ++k) {
      const Candidate& c = view.candidates[k];
      if (k == view.winner) continue;
      if (c.fate == Candidate::Fate::kept)
        svg.circle(frame.at(c.position), 3.2, {.fill = "#fff", .stroke = "#5b2c83", .width = 1.5});
      else
        draw_cross(svg, frame.at(c.position), 3);
    }
    svg.circle(frame.at(view.candidates[view.winner].position), 5.5,
               {.fill = best_colour, .stroke = "#fff", .width = 1.2});
  }
  draw_look(svg, frame, round.scan, index + 1, 8);
}

std::string grouped(std::size_t value) {
  std::string text = std::to_string(value);
  for (std::size_t k = text.size(); k > 3; k -= 3) text.insert(k - 3, 1, ',');
  return text;
}

// The exploration in words, a line a step.
std::vector<std::string> steps(const Exploration& e) {
  std::vector<std::string> lines;
  for (std::size_t k = 0; k < e.rounds.size(); ++k) {
    const Scan& scan = e.rounds[k].scan;
    std::size_t fresh = 0;
    for (const std::size_t n : scan.newly_seen) fresh += n;
    lines.push_back(fmt::format("{}  looks from ({:.1f}, {:.1f}): {} new, {} unseen", k + 1, scan.at.x_m,
                                scan.at.y_m, grouped(fresh), grouped(scan.unseen_after)));
    if (!e.rounds[k].next) continue;
    const NextBestView& view = *e.rounds[k].next;
    std::string way;
    Point from = scan.at;
    double size = 0;
    for (std::size_t p = 0; p < view.path.size(); ++p) {
      if (p + 1 < view.path.size())
        way +=
            fmt::format("{} ({:.1f}, {:.1f})", p == 0 ? " round" : ",", view.path[p].x_m, view.path[p].y_m);
      size += distance_m(std::exchange(from, view.path[p]), view.path[p]);
    }
    if (view.path.size() > 3) way = fmt::format(" round {} corners", view.path.size() - 1);
    lines.push_back(fmt::format("     drives {:.1f} m{}", size, way));
  }
  return lines;
}

constexpr std::size_t most_step_lines = 16;

double draw_steps(Svg& svg, double x, double y, const Exploration& e) {
  svg.text({x, y}, "Steps", {.size = 14, .bold = true});
  std::vector<std::string> lines = steps(e);
  if (lines.size() > most_step_lines) {
    const std::size_t left_out = lines.size() - (most_step_lines - 1);
    lines.resize(most_step_lines - 1);
    lines.push_back(fmt::format("     and {} more", left_out));
  }
  for (const std::string& line : lines) {
    y += row_px;
    const bool drive = line.starts_with(' ');
    svg.text({x + (drive ? 20 : 0), y}, std::string_view(line).substr(drive ? 5 : 0),
             {.size = 12.5, .fill = drive ? "#666" : "#222"});
  }
  y += row_px;
  svg.text({x, y},
           fmt::format("{}: {} of {} nodes unseen", e.outcome == Outcome::explored ? "Explored" : "Stuck",
                       e.unseen, grouped(e.nodes.size())),
           {.size = 12.5, .bold = true});
  y += row_px;
  svg.text({x, y},
           fmt::format("{:.1f} m driven, {:.1f} full turns on the spot", e.length_m(),
                       e.turned_rad() / (2 * std::numbers::pi)),
           {.size = 12.5});
  return y;
}

double draw_energy(Svg& svg, double x, double y, std::span<const MissionEnergy> energy) {
  if (energy.empty()) return y;
  svg.text({x, y}, "Energy of the motors [J]", {.size = 14, .bold = true});
  constexpr std::array<double, 5> right_edges{60, 130, 225, 320, 400};
  constexpr std::array<std::string_view, 5> heads{"payload", "turns", "triangle", "optimal", "saving"};
  y += row_px;
  for (std::size_t k = 0; k < heads.size(); ++k)
    svg.text({x + right_edges[k], y}, heads[k], {.size = 12, .fill = "#666", .anchor = SvgAnchor::end});
  svg.line({x, y + 5}, {x + right_edges.back(), y + 5}, {.stroke = "#999"});
  y += 3;
  for (const MissionEnergy& e : energy) {
    y += row_px;
    const std::array<std::string, 5> cells{
        fmt::format("{:g} kg", e.payload_kg), fmt::format("{:.1f}", e.turns.energy_j),
        fmt::format("{:.1f}", e.triangle_total_j()), fmt::format("{:.1f}", e.optimal_total_j()),
        fmt::format("{:.1f} %", 100 * e.saving())};
    for (std::size_t k = 0; k < cells.size(); ++k)
      svg.text({x + right_edges[k], y}, cells[k], {.size = 12.5, .anchor = SvgAnchor::end});
  }
  const MissionEnergy& first = energy.front();
  y += row_px + 3;
  svg.text({x, y},
           fmt::format("triangle: {:.2g} m/s at its peak, {:.0f} s; optimal: at most {:.2f} m/s, {:.0f} s",
                       first.triangle.peak_speed_m_s, first.triangle.duration_s + first.turns.duration_s,
                       first.optimal.peak_speed_m_s, first.optimal.duration_s + first.turns.duration_s),
           {.size = 11, .fill = "#666"});
  y += 16;
  svg.text({x, y},
           fmt::format("totals include turns, at {:.2g} rad/s; times at {:g} kg", first.turn_rate_rad_s,
                       first.payload_kg),
           {.size = 11, .fill = "#666"});
  return y;
}

double draw_legend(Svg& svg, double x, double y, std::size_t rounds) {
  svg.text({x, y}, "Legend", {.size = 14, .bold = true});
  const double second = x + 215;
  y += row_px;
  const auto words = [&](double column, double line, std::string_view text) {
    svg.text({column + 38, line + 4}, text, {.size = 12});
  };
  const auto swatch = [&](double column, double line, std::string_view colour) {
    svg.rect(column, line - 7, 28, 14, {.fill = colour, .stroke = "#bbb", .width = 0.6});
  };
  const std::size_t tints = std::min(rounds, seen_colours.size());
  for (std::size_t k = 0; k < tints; ++k) {
    const double part = 28.0 / static_cast<double>(tints);
    svg.rect(x + static_cast<double>(k) * part, y - 7, part, 14, {.fill = seen_colours[k]});
  }
  words(x, y, "seen (darker: later)");
  svg.circle({second + 14, y}, 7, {.fill = "#fff", .stroke = robot_colour, .width = 2});
  words(second, y, "look all round, and heading");
  y += row_px;
  swatch(x, y, unseen_colour);
  words(x, y, "unseen");
  svg.line({second, y}, {second + 28, y}, {.stroke = path_colour, .width = 2.2});
  draw_arrow(svg, {second + 19, y}, 1, 0, 10, path_colour);
  words(second, y, "straight leg");
  y += row_px;
  swatch(x, y, occupied_colour);
  words(x, y, "occupied");
  svg.circle({second + 14, y}, 4.5, {.fill = "#fff", .stroke = path_colour, .width = 2});
  words(second, y, "corner rounded (DistBug)");
  y += row_px;
  swatch(x, y, obstacle_colour);
  words(x, y, "obstacle");
  svg.circle({second + 14, y}, 5.5, {.fill = best_colour});
  words(second, y, "next best view");
  y += row_px;
  svg.rect(x, y - 7, 28, 14, {.stroke = outline_colour, .width = 1.2, .dash = "5 3"});
  words(x, y, "grown by the safety radius");
  svg.circle({second + 8, y}, 3.2, {.fill = "#fff", .stroke = "#5b2c83", .width = 1.5});
  draw_cross(svg, {second + 22, y}, 3);
  words(second, y, "candidate kept, dropped");
  return y;
}

}  // namespace

std::string draw_exploration(std::string_view title, const Map& map, const Exploration& e,
                             std::span<const MissionEnergy> energy) {
  const double left = margin_px + 26, top = margin_px + 44;
  const Frame whole(map, left, top, main_px);
  const double step_lines =
      static_cast<double>(std::min(steps(e).size(), most_step_lines) + 1 + energy.size()) * row_px;
  const double side_height = step_lines + 310;
  const double upper = std::max(whole.height() + 36, side_height);
  const Frame sample(map, 0, 0, panel_px);
  const std::size_t panels = e.rounds.size();
  const std::size_t panel_rows = (panels + panels_a_row - 1) / panels_a_row;
  const double panel_height = sample.height() + 44;
  const double width = left + whole.width() + 36 + column_px + margin_px;
  const double width_needed =
      std::max(width, left + static_cast<double>(std::min(panels, panels_a_row)) * (sample.width() + 22));
  const double height = top + upper + 30 + static_cast<double>(panel_rows) * panel_height + margin_px;

  Svg svg = Svg::document(width_needed, height, title);
  svg.text({left, margin_px + 8}, title, {.size = 18, .bold = true});
  draw_whole(svg, whole, e);

  const double x = left + whole.width() + 36;
  double y = draw_steps(svg, x, top + 10, e);
  y = draw_energy(svg, x, y + 36, energy);
  draw_legend(svg, x, y + 36, e.rounds.size());

  const double panels_top = top + upper + 30;
  for (std::size_t k = 0; k < panels; ++k) {
    const double px = left + static_cast<double>(k % panels_a_row) * (sample.width() + 22);
    const double py = panels_top + static_cast<double>(k / panels_a_row) * panel_height;
    const Round& round = e.rounds[k];
    std::string caption = fmt::format("Look {}: {} unseen", k + 1, grouped(round.scan.unseen_after));
    if (round.next)
      caption +=
          fmt::format(", next shows {}", grouped(round.next->candidates[round.next->winner].unseen_visible));
    svg.text({px, py + sample.height() + 17}, caption, {.size = 11.5});
    draw_round(svg, Frame(map, px, py, panel_px), e, k);
  }
  return svg.str();
}

}  // namespace joulecast::report
