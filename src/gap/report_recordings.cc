#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "base/xml_text.h"
#include "gap/chart.h"
#include "gap/power_gap.h"
#include "gap/report_page.h"
#include "gap/verdict_text.h"
#include "gap/where.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t bins = 9;
constexpr double block_s = 8;     // within which readings are not independent
constexpr double stretch_s = 90;  // of power over time that is drawn
constexpr std::size_t floor_cells = 26;
constexpr std::size_t most_rows = 40;

// Battery power of every window, measured and by the model without and with the effects found [W].
struct Powers {
  std::vector<Window> windows;
  std::vector<double> measured, before, after;
  std::vector<double> cost;   // mean |change of power| by each effect [W]
  double mean = 0;            // |measured|
  bool from_battery = true;   // otherwise the motors' with the idle power
  bool with_effects = false;  // else `after` is `before`

  bool any_known() const { return mean > 0; }
  bool known(std::size_t k) const { return std::isfinite(measured[k] - before[k]); }
  double gap(std::size_t k) const { return measured[k] - before[k]; }
  double rest(std::size_t k) const { return measured[k] - after[k]; }
};

Powers powers_of(const Diagnosis& d, const telemetry::RecordingSet& recordings, const robot::RobotModel& robot) {
  Powers p;
  p.windows = make_windows(recordings, robot);
  p.measured = measured_power(p.windows);
  p.from_battery = std::ranges::any_of(p.measured, [](double w) { return std::isfinite(w); });
  if (!p.from_battery) {
    for (std::size_t k = 0; k < p.windows.size(); ++k)
      p.measured[k] = robot.idle_power_w + p.windows[k].motor_power_w[0] + p.windows[k].motor_power_w[1];
  }
  std::vector<dynamics::ActiveEffect> effects;
  for (const robot::AdoptedEffect& adopted : d.adoptable) {
    if (auto active = dynamics::activate(adopted)) effects.push_back(*active);
  }
  p.with_effects = !effects.empty();
  p.before = modelled_power(robot, {}, p.windows);
  p.after = modelled_power(robot, effects, p.windows);
  std::size_t count = 0;
  for (std::size_t k = 0; k < p.windows.size(); ++k) {
    if (!p.known(k)) continue;
    p.mean += std::fabs(p.measured[k]);
    ++count;
  }
  p.mean /= static_cast<double>(std::max<std::size_t>(1, count));
  for (const DiagnosedEffect& e : d.effects) {
    std::vector<dynamics::ActiveEffect> others;
    for (const dynamics::ActiveEffect& effect : effects) {
      if (effect.effect->info().id != e.id) others.push_back(effect);
    }
    const std::vector<double> without = modelled_power(robot, others, p.windows);
    double change = 0;
    for (std::size_t k = 0; k < without.size(); ++k) {
      if (p.known(k)) change += std::fabs(p.after[k] - without[k]);
    }
    p.cost.push_back(change / static_cast<double>(std::max<std::size_t>(1, count)));
  }
  return p;
}

std::string variable_words(const std::string& variable) {
  static const std::map<std::string, std::string> words{{"speed_m_s", "speed, m/s"},
                                                        {"acceleration_m_s2", "acceleration, m/s²"},
                                                        {"yaw_rate_rad_s", "yaw rate, rad/s"},
                                                        {"payload_kg", "payload, kg"},
                                                        {"time_s", "time, s"},
                                                        {"heading_rad", "heading, rad"},
                                                        {"x_m", "x, m"},
                                                        {"y_m", "y, m"}};
  const auto found = words.find(variable);
  return found == words.end() ? words_of(variable) : found->second;
}

std::string effect_names(const Diagnosis& d) {
  std::vector<std::string> names;
  for (const DiagnosedEffect& e : d.effects) {
    std::string name = words_of(e.id);
    if (!e.alternatives.empty()) {
      std::vector<std::string> others;
      for (const std::string& id : e.alternatives) others.push_back(words_of(id));
      name += " (or " + enumerate(others) + ", which these data do not tell from it)";
    }
    names.push_back(std::move(name));
  }
  return enumerate(names);
}

std::string sentence_of(const Diagnosis& d) {
  const std::string gap =
      std::isfinite(d.power_absolute_relative)
          ? fmt::format("measured battery power and the model's differ by {} of the power",
                        percent(d.power_absolute_relative))
          : std::string("the motors' currents were recorded but no power");
  switch (d.verdict) {
    case Verdict::effects: {
      std::string text = fmt::format("On {} missions {}. {} {} it", d.missions, gap, effect_names(d),
                                     d.effects.size() == 1 ? "explains" : "explain");
      const auto start = text.find(". ") + 2;
      text[start] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[start])));
      if (d.shrinkage) {
        text += fmt::format(": on missions left out of the fit the gap falls from {} to {}",
                            percent(d.shrinkage->before), percent(d.shrinkage->after));
      }
      return text + ".";
    }
    case Verdict::none:
      return fmt::format(
          "On {} missions {}. That is what noise ({}) and ordinary scatter between missions make: "
          "no effect is missing that these data could show.",
          d.missions, gap, percent(d.noise_floor));
    case Verdict::outside:
      return fmt::format(
          "On {} missions {}. Part of it comes from something outside the catalogue of effects. {}",
          d.missions, gap, fmt::join(verdict_reasons(d), " "));
    case Verdict::inconclusive:
      break;
  }
  std::vector<std::string> likeliest;
  for (const DiagnosedEffect& e : d.effects) likeliest.push_back(words_of(e.id));
  return fmt::format("On {} missions {}. These data do not decide what causes it{}. {}", d.missions, gap,
                     likeliest.empty() ? "" : "; likeliest: " + enumerate(likeliest),
                     fmt::join(verdict_reasons(d), " "));
}

void shrinkage_section(Page& page, const Diagnosis& d) {
  if (!d.shrinkage) return;
  const Shrinkage& s = *d.shrinkage;
  page.section("How far the gap shrinks",
               "Mean absolute difference between measured and modelled battery power, of the mean power, on "
               "missions that were left out of the fit.");
  const std::vector<BarRow> rows{
      {"model as it is", "", 100 * s.before, {}, "before"},
      {"with the effects",
       "",
       100 * s.after,
       {100 * s.before * (1 - s.interval[1]), 100 * s.before * (1 - s.interval[0])},
       "after"},
      {"noise alone", "", 100 * d.noise_floor, {}, "floor"}};
  std::string caption = fmt::format("It falls by {} (95 % interval {} to {}, bootstrap over blocks of time).",
                                    percent(s.fraction), percent(s.interval[0]), percent(s.interval[1]));
  if (s.interval[1] < 0) {
    caption += " It grows: these effects are no explanation.";
  } else if (s.interval[0] < 0) {
    caption += " The interval holds zero: that the effects help on missions left out is not sure.";
  }
  if (std::isfinite(s.remaining_over_noise_floor))
    caption += fmt::format(" What remains is {:.1f} times what measurement noise alone makes.",
                           s.remaining_over_noise_floor);
  page.chart(bars(rows, " %", "gap before and after"), caption);
  if (d.effects.size() > 1) {
    std::vector<BarRow> shares;
    for (const DiagnosedEffect& e : d.effects)
      shares.push_back({words_of(e.id), "", 100 * e.share, {}, "after"});
    page.chart(
        bars(shares, " %", "share of the gap that each effect explains"),
        "What each effect takes off the gap, averaged over the orders of adding them (Shapley shares).");
  }
}

struct Bin {
  double before = 0, after = 0;
  std::size_t count = 0;
  std::map<std::pair<std::size_t, int>, std::pair<double, double>> blocks;  // sum, count

  void add(const Powers& p, std::size_t k) {
    before += p.gap(k);
    after += p.rest(k);
    ++count;
    auto& [sum, n] = blocks[{p.windows[k].mission, static_cast<int>(p.windows[k].t_s / block_s)}];
    sum += p.gap(k);
    n += 1;
  }
  double mean_before() const { return before / static_cast<double>(count); }
  double mean_after() const { return after / static_cast<double>(count); }
  // Half of a 95 % interval of the mean, by blocks.
  double half_width() const {
    if (blocks.size() < 3) return missing;
    double square = 0;
    for (const auto& [key, block] : blocks) {
      const double residual = block.first - mean_before() * block.second;
      square += residual * residual;
    }
    const double n = static_cast<double>(blocks.size());
    return 1.96 * std::sqrt(square * n / (n - 1)) / static_cast<double>(count);
  }
};

std::string chart_of(const std::vector<Bin>& cells, std::span<const double> edges,
                     std::span<const std::string> labels, const std::string& axis, bool with_effects) {
  double low = 0, high = 0;
  for (const Bin& b : cells) {
    if (b.count == 0) continue;
    const double half = std::isfinite(b.half_width()) ? b.half_width() : 0;
    low = std::min({low, b.mean_before() - half, b.mean_after()});
    high = std::max({high, b.mean_before() + half, b.mean_after()});
  }
  const double margin = 0.06 * std::max(high - low, 1e-9);
  if (low < 0) low -= margin;
  high += margin;
  Chart chart(420, 230, {edges.front(), edges.back(), axis, labels.empty()},
              {low, high, "missed power, W", true}, "power that the model misses over " + axis);
  chart.level(0, "zero");
  for (std::size_t b = 0; b < cells.size(); ++b) {
    const Bin& bin = cells[b];
    const double from = edges[b], to = edges[b + 1], width = to - from, middle = from + 0.5 * width;
    if (!labels.empty()) chart.category(middle, labels[b]);
    if (bin.count < 5) continue;
    const double before_to = with_effects ? middle : to - 0.08 * width;
    const std::string then = with_effects ? fmt::format(" before, {} W after", brief(bin.mean_after())) : "";
    const std::string hint = fmt::format("{} W{}, {} windows", brief(bin.mean_before()), then, bin.count);
    chart.bar(from + 0.08 * width, before_to, 0, bin.mean_before(), "before", hint);
    if (with_effects) chart.bar(middle, to - 0.08 * width, 0, bin.mean_after(), "after", hint);
    if (const double half = bin.half_width(); std::isfinite(half)) {
      const double at = 0.5 * (from + 0.08 * width + before_to);
      chart.segment({at, bin.mean_before() - half}, {at, bin.mean_before() + half}, "whisker");
    }
  }
  return chart.str();
}

// Charts of the missed power over what may drive it.
std::vector<std::pair<std::string, std::string>> maps_of(const Powers& p, const robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m, l = robot.kinematics.half_track_m;
  std::vector<std::pair<std::string, std::string>> maps;
  const std::vector<std::string> phases{"standstill", "acceleration", "cruise", "braking", "turning"};
  std::vector<Bin> by_phase(phases.size());
  for (std::size_t k = 0; k < p.windows.size(); ++k) {
    if (!p.known(k)) continue;
    const auto found = std::ranges::find(phases, phase_of(p.windows[k], r));
    if (found != phases.end()) by_phase[static_cast<std::size_t>(found - phases.begin())].add(p, k);
  }
  const std::vector<double> places{0, 1, 2, 3, 4, 5};
  maps.emplace_back(chart_of(by_phase, places, phases, "phase", p.with_effects), "");
  struct Variable {
    std::string axis;
    std::function<double(const Window&)> value;
  };
  const std::vector<Variable> variables{
      {"speed, m/s", [r](const Window& w) { return 0.5 * r * (w.speed_rad_s[0] + w.speed_rad_s[1]); }},
      {"acceleration, m/s²",
       [r](const Window& w) { return 0.5 * r * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]); }},
      {"yaw rate, rad/s (left positive)",
       [r, l](const Window& w) { return r * (w.speed_rad_s[0] - w.speed_rad_s[1]) / (2 * l); }},
      {"payload, kg", [](const Window& w) { return w.payload_kg; }},
      {"time since the mission began, s", [](const Window& w) { return w.t_s; }},
      {"heading, rad", [](const Window& w) {
         return std::isfinite(w.heading_rad) ? std::remainder(w.heading_rad, 2 * std::numbers::pi) : missing;
       }}};
  for (const Variable& v : variables) {
    std::vector<double> values;
    for (std::size_t k = 0; k < p.windows.size(); ++k) {
      if (p.known(k) && std::isfinite(v.value(p.windows[k]))) values.push_back(v.value(p.windows[k]));
    }
    if (values.size() < 40) continue;
    std::ranges::sort(values);
    // The outermost half percent would stretch the axis for a handful of windows.
    const double low = values[values.size() / 200], high = values[values.size() - 1 - values.size() / 200];
    if (!(high - low > 1e-6 * std::max(std::fabs(high), 1.0))) continue;
    std::vector<double> edges;
    for (std::size_t b = 0; b <= bins; ++b)
      edges.push_back(low + (high - low) * static_cast<double>(b) / static_cast<double>(bins));
    std::vector<Bin> cells(bins);
    for (std::size_t k = 0; k < p.windows.size(); ++k) {
      const double at = v.value(p.windows[k]);
      if (!p.known(k) || !(at >= low && at <= high)) continue;
      cells[std::min(bins - 1, static_cast<std::size_t>((at - low) / (high - low) * bins))].add(p, k);
    }
    maps.emplace_back(chart_of(cells, edges, {}, v.axis, p.with_effects), "");
  }
  return maps;
}

void floor_map(Page& page, const Powers& p) {
  double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
  for (std::size_t k = 0; k < p.windows.size(); ++k) {
    const Window& w = p.windows[k];
    if (!p.known(k) || !std::isfinite(w.x_m + w.y_m)) continue;
    x0 = std::min(x0, w.x_m), x1 = std::max(x1, w.x_m);
    y0 = std::min(y0, w.y_m), y1 = std::max(y1, w.y_m);
  }
  if (!(std::max(x1 - x0, y1 - y0) > 0.5)) return;
  const double cell = std::max(x1 - x0, y1 - y0) / static_cast<double>(floor_cells);
  std::map<std::pair<int, int>, Bin> cells;
  for (std::size_t k = 0; k < p.windows.size(); ++k) {
    const Window& w = p.windows[k];
    if (!p.known(k) || !std::isfinite(w.x_m + w.y_m)) continue;
    cells[{static_cast<int>((w.x_m - x0) / cell), static_cast<int>((w.y_m - y0) / cell)}].add(p, k);
  }
  std::erase_if(cells, [](const auto& c) { return c.second.count < 3; });
  std::vector<double> sizes;
  for (const auto& [at, bin] : cells) sizes.push_back(std::fabs(bin.mean_before()));
  if (sizes.size() < 4) return;
  std::ranges::sort(sizes);
  const double strong = std::max(sizes[sizes.size() * 95 / 100], 1e-9);
  constexpr double plot = 380;  // of each picture's longer side, axes apart
  const double scale = plot / (std::max(x1 - x0, y1 - y0) + cell);
  const auto picture = [&](bool after) {
    Chart chart((x1 - x0 + cell) * scale + 64, (y1 - y0 + cell) * scale + 50, {x0, x1 + cell, "x, m", true},
                {y0, y1 + cell, "y, m", true},
                after ? "floor map, with the effects" : "floor map, model as it is");
    for (const auto& [at, bin] : cells) {
      const double value = after ? bin.mean_after() : bin.mean_before();
      const ChartPoint low{x0 + at.first * cell, y0 + at.second * cell};
      chart.cell(low, {low.x + cell, low.y + cell}, value > 0 ? "more" : "less",
                 0.06 + 0.94 * std::min(1.0, std::fabs(value) / strong),
                 fmt::format("{} W missed, {} windows", brief(value), bin.count));
    }
    return chart.str();
  };
  page.section(
      "Where on the floor",
      fmt::format("Mean missed power where the robot drove; full colour is {} W.", brief(strong, 2)));
  const std::vector<std::pair<std::string, std::string>> legend{{"more", "takes more than the model says"},
                                                                {"less", "takes less"}};
  page.legend(legend);
  std::vector<std::pair<std::string, std::string>> pictures{{picture(false), "Model as it is"}};
  if (p.with_effects) pictures.emplace_back(picture(true), "With the effects found");
  page.charts(pictures);
}

std::string mission_name(const telemetry::RecordingSet& set, std::size_t mission) {
  if (set.missions.size() == 1) return "part " + std::to_string(mission + 1);
  return set.missions[mission].mission_id;
}

// The stretch of time whose power the model misses most.
void power_section(Page& page, const Powers& p, const telemetry::RecordingSet& set) {
  std::map<std::pair<std::size_t, int>, double> halves;  // half stretches of missions
  for (std::size_t k = 0; k < p.windows.size(); ++k) {
    if (p.known(k))
      halves[{p.windows[k].mission, static_cast<int>(p.windows[k].t_s / (stretch_s / 2))}] +=
          std::fabs(p.gap(k));
  }
  if (halves.empty()) return;
  std::pair<std::size_t, int> worst = halves.begin()->first;
  double most = -1;
  for (const auto& [at, sum] : halves) {
    const auto next = halves.find({at.first, at.second + 1});
    const double both = sum + (next == halves.end() ? 0 : next->second);
    if (both > most) {
      most = both;
      worst = at;
    }
  }
  const double from = worst.second * stretch_s / 2;
  std::vector<ChartPoint> measured, before, after;
  double low = 0, high = 0;
  for (std::size_t k = 0; k < p.windows.size(); ++k) {
    const Window& w = p.windows[k];
    if (w.mission != worst.first || w.t_s < from || w.t_s > from + stretch_s || !p.known(k)) continue;
    if (!w.continues && !measured.empty()) {
      for (auto* line : {&measured, &before, &after}) line->push_back({w.t_s, missing});
    }
    measured.push_back({w.t_s, p.measured[k]});
    before.push_back({w.t_s, p.before[k]});
    after.push_back({w.t_s, p.after[k]});
    low = std::min({low, p.measured[k], p.before[k], p.after[k]});
    high = std::max({high, p.measured[k], p.before[k], p.after[k]});
  }
  if (measured.size() < 5) return;
  page.section("Power over time",
               fmt::format("{}, the {} s with the largest gap.", mission_name(set, worst.first),
                           brief(measured.back().x - measured.front().x, 2)));
  std::vector<std::pair<std::string, std::string>> legend{{"measured", "measured"},
                                                          {"before", "model as it is"}};
  if (p.with_effects) legend.emplace_back("after", "with the effects found");
  page.legend(legend);
  Chart chart(
      820, 300, {measured.front().x, measured.back().x, "time since the mission began, s", true},
      {low, high * 1.05, p.from_battery ? "battery power, W" : "motor power with idle power, W", true},
      "measured and modelled power");
  chart.level(0, "zero");
  chart.line(before, "before");
  if (p.with_effects) chart.line(after, "after");
  chart.line(measured, "measured");
  page.chart(chart.str());
}

void where_section(Page& page, const Diagnosis& d, const Powers& p, const robot::RobotModel& robot) {
  page.section(
      "Where the model misses",
      "Mean of measured less modelled power in ranges of one variable each. Above zero the robot takes more "
      "than the model says. Whiskers: 95 % intervals of the model as it is, by blocks of 8 s.");
  std::vector<std::pair<std::string, std::string>> legend{{"before", "model as it is"}};
  if (p.with_effects) legend.emplace_back("after", "with the effects found");
  page.legend(legend);
  page.charts(maps_of(p, robot));
  if (d.where.empty()) {
    page.paragraph("No region stands out once the number of regions looked at is allowed for.");
    return;
  }
  std::vector<std::vector<std::string>> rows;
  for (const WhereRegion& w : d.where) {
    rows.push_back(
        {xml_escaped(words_of(w.channel)), xml_escaped(variable_words(w.variable)),
         w.label.empty() ? brief_range(w.from, w.to) : xml_escaped(w.label),
         fmt::format("{} [{}, {}]", percent(w.share), percent(w.interval[0], 2), percent(w.interval[1], 2))});
    if (rows.size() >= 12) break;
  }
  page.paragraph(
      "Regions that stand out, worst first; their shares overlap, since each looks at all of the data by "
      "one variable:");
  const std::vector<std::string> header{"Shows in", "by", "range", "share of the gap [95 %]"};
  page.table(header, rows, 3);
}

void missions_table(Page& page, const Powers& p, const telemetry::RecordingSet& set) {
  struct Total {
    double measured = 0, gap = 0, rest = 0, absolute = 0, absolute_after = 0, size = 0;
  };
  std::map<std::size_t, Total> totals;
  for (std::size_t k = 0; k < p.windows.size(); ++k) {
    if (!p.known(k)) continue;
    Total& t = totals[p.windows[k].mission];
    t.measured += p.measured[k];
    t.gap += p.gap(k);
    t.rest += p.rest(k);
    t.absolute += std::fabs(p.gap(k));
    t.absolute_after += std::fabs(p.rest(k));
    t.size += std::fabs(p.measured[k]);
  }
  std::vector<std::vector<std::string>> rows;
  for (const auto& [m, t] : totals) {
    const telemetry::Recording& mission = set.missions[set.missions.size() == 1 ? 0 : m];
    const auto begin = mission.samples.front().utime_us;
    const double length_s = 1e-6 * static_cast<double>(mission.samples.back().utime_us - begin);
    const auto seconds = static_cast<std::time_t>(begin / 1'000'000);
    std::tm utc{};
    gmtime_r(&seconds, &utc);
    rows.push_back({xml_escaped(mission_name(set, m)),
                    fmt::format("{:04}-{:02}-{:02} {:02}:{:02}", utc.tm_year + 1900, utc.tm_mon + 1,
                                utc.tm_mday, utc.tm_hour, utc.tm_min),
                    brief(set.missions.size() == 1 ? length_s / single_mission_parts : length_s),
                    std::isfinite(mission.payload_kg) ? brief(mission.payload_kg) : "–",
                    percent(t.gap / t.measured), percent(t.rest / t.measured), percent(t.absolute / t.size),
                    percent(t.absolute_after / t.size)});
    if (rows.size() >= most_rows) break;
  }
  const std::vector<std::string> header{"Mission",      "began (UTC)",   "s",
                                        "payload kg",   "energy missed", "with effects",
                                        "power missed", "with effects"};
  page.table(header, rows, 2);
  page.paragraph("Missed energy and power by mission; with effects: as fitted to all of these missions.");
  if (totals.size() > rows.size())
    page.paragraph(fmt::format("The first {} of {} missions.", rows.size(), totals.size()));
}

std::vector<std::string> limits_of(const Diagnosis& d, const Powers& p) {
  std::vector<std::string> limits;
  if (!d.motor_channels) {
    limits.emplace_back(
        "The motors' voltage and current were not recorded. The judgement rests on battery power and motion "
        "alone, "
        "so that effects in the motors, the drivers and friction are harder to tell apart.");
  }
  if (!p.from_battery && p.any_known())
    limits.emplace_back(
        "The battery was not recorded; power is that of the motors with the file's idle power.");
  const auto any = [&](auto&& measured) { return std::ranges::any_of(p.windows, measured); };
  if (!any([](const Window& w) { return std::isfinite(w.yaw_rate_rad_s); }))
    limits.emplace_back("No gyro: slip and errors of the track show only through the map, if at all.");
  if (!any([](const Window& w) { return std::isfinite(w.x_m); }))
    limits.emplace_back(
        "No pose: nothing is tied to places on the floor, and wheel radius and slip are not seen.");
  double least = 1e300, most = -1e300;
  for (const Window& w : p.windows) {
    least = std::min(least, w.payload_kg);
    most = std::max(most, w.payload_kg);
  }
  if (!(most - least > 0.5))
    limits.emplace_back(
        "One payload throughout: effects of the load are not told from those of the robot's own weight.");
  for (const DiagnosedEffect& e : d.effects) {
    if (e.alternatives.empty()) continue;
    std::vector<std::string> others;
    for (const std::string& id : e.alternatives) others.push_back(words_of(id));
    limits.push_back(
        fmt::format("{} and {} are not told apart; adopting the first is as good as these data allow.",
                    words_of(e.id), enumerate(others)));
  }
  limits.emplace_back(
      "Effects are named from the catalogue; several small ones can look like one of it. Strengths hold for "
      "the "
      "conditions driven.");
  return limits;
}

}  // namespace

std::string report_html(const Diagnosis& d, const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                        const ReportOrigin& origin) {
  const Powers p = powers_of(d, recordings, robot);
  Page page("Why robot " + d.robot_id + " takes other power than its model says",
            "Sim-to-real gap from recorded missions", sentence_of(d));
  std::vector<Page::Figure> figures{
      {percent(d.power_absolute_relative), "of the power is missed by the model as it is"},
      {percent(d.noise_floor), "is what measurement noise alone makes"}};
  if (d.shrinkage && !d.effects.empty()) {
    figures.insert(figures.begin() + 1,
                   {percent(d.shrinkage->after), "is missed with the effects, on missions left out"});
  }
  figures.push_back(
      {percent(d.energy_relative), "of the energy is missed: positive is more than the model says"});
  figures.push_back({probability_text(d.verdict_probability),
                     "probability of the verdict \"" + std::string(name_of(d.verdict)) + "\""});
  page.figures(figures);
  std::vector<std::string> costs;
  for (const double w : p.cost) {
    if (!p.any_known()) break;
    costs.push_back(fmt::format("it changes the power by {} W on average, {} of {} W", brief(w),
                                percent(w / p.mean), brief(p.mean)));
  }
  effects_section(page, d.effects, costs);
  if (!d.outside.channel.empty()) {
    page.card(
        fmt::format("<h3>Outside the catalogue</h3><p>Something is at work that no effect of the catalogue "
                    "describes, with "
                    "a probability of {}. {}</p>",
                    probability_text(d.outside.probability), xml_escaped(outside_words(d.outside))));
  } else {
    page.paragraph(fmt::format("Probability that something outside the catalogue is at work: {}.",
                               probability_text(d.outside.probability)));
  }
  shrinkage_section(page, d);
  if (p.any_known()) {
    where_section(page, d, p, robot);
    floor_map(page, p);
    power_section(page, p, recordings);
  } else {
    page.section("Where the model misses");
    page.paragraph(
        "No power was recorded, so that there is no missed power to draw; effects were named from torques.");
  }
  page.section("What to drive next", "Manoeuvres that would tell apart what these data cannot.");
  if (d.next_drive.empty()) page.paragraph("Nothing is left to tell apart.");
  std::vector<std::vector<std::string>> drives;
  for (const NextDrive& n : d.next_drive)
    drives.push_back(
        {xml_escaped(n.manoeuvre), xml_escaped(words_of(n.separates)), brief(n.expected_log_evidence, 2)});
  const std::vector<std::string> drive_header{"Drive", "to tell", "log evidence it adds"};
  if (!drives.empty()) page.table(drive_header, drives, 2);
  page.section("Limits");
  page.list(limits_of(d, p));
  page.section("Method");
  const std::vector<std::string> method{
      "Recordings are averaged under smooth windows of about 0.4 s; slopes are taken under the windows' "
      "slopes, so that "
      "no noisy signal is differentiated.",
      "Each equation between measured channels (motor voltage, wheel torque, battery power, battery voltage, "
      "yaw rate, "
      "progress on the map) is compared with the drive model; each effect of the catalogue has its own trace "
      "in them.",
      "Readings are whitened, and scatter between missions and calibration tolerances are integrated out, so "
      "that "
      "ordinary scatter is no effect. Sets of effects are compared by their evidence; flexible trends stand "
      "for what the "
      "catalogue does not know.",
      "The fall of the gap is measured on missions that the fit has not seen, each left out in turn."};
  page.list(method);
  origin_section(page, origin, robot);
  page.paragraph(fmt::format("{} missions with {} samples{}.", d.missions, d.samples,
                             recordings.unreadable > 0
                                 ? fmt::format("; {} messages could not be read", recordings.unreadable)
                                 : ""));
  if (p.any_known()) missions_table(page, p, recordings);
  return page.str();
}

}  // namespace joulecast::gap
