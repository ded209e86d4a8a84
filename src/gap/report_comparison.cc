#include <fmt/format.h>

#include <cmath>

#include "base/xml_text.h"
#include "dynamics/catalogue.h"
#include "gap/chart.h"
#include "gap/report_page.h"

namespace joulecast::gap {
namespace {

std::string sentence_of(const Comparison& c) {
  std::vector<std::string> names, differing;
  for (const ComparedGroup& g : c.groups) names.push_back(g.name);
  for (const ComparedEffect& e : c.effects) {
    if (!e.differs || !e.possible) continue;
    std::size_t least = 0, most = 0;
    for (std::size_t g = 0; g < e.groups.size(); ++g) {
      if (e.groups[g].value < e.groups[least].value) least = g;
      if (e.groups[g].value > e.groups[most].value) most = g;
    }
    differing.push_back(fmt::format("{} (from {} in {} to {} in {})", words_of(e.id),
                                    brief(e.groups[least].value), c.groups[least].name,
                                    brief(e.groups[most].value), c.groups[most].name));
  }
  if (differing.empty())
    return "Between " + enumerate(names) + " nothing changes that these recordings could show.";
  return fmt::format("Between {} {} {}.", enumerate(names), differing.size() == 1 ? "changes" : "change",
                     enumerate(differing));
}

}  // namespace

std::string report_html(const Comparison& c, const robot::RobotModel& robot, const ReportOrigin& origin) {
  Page page("What changes for robot " + c.robot_id + " between groups of recordings",
            "Comparison of recordings", sentence_of(c));
  page.section(
      "Strengths by group",
      "Each effect with its strength in every group. Whiskers: 95 %, by leaving out one mission at a time.");
  for (const ComparedEffect& e : c.effects) {
    std::vector<BarRow> rows;
    for (std::size_t g = 0; g < e.groups.size(); ++g) {
      const GroupStrength& s = e.groups[g];
      BarRow row{c.groups[g].name, with_deviation(s.value, s.deviation, e.unit), s.value, {}, "after"};
      if (std::isfinite(s.deviation))
        row.interval = {s.value - 1.96 * s.deviation, s.value + 1.96 * s.deviation};
      rows.push_back(std::move(row));
    }
    const dynamics::Effect* known = dynamics::find_effect(e.id);
    std::string meaning = e.parameter;
    if (known != nullptr) {
      for (const auto& info : known->info().parameters) {
        if (info.name == e.parameter) meaning = info.meaning;
      }
    }
    page.card(fmt::format(
        "<h3>{} <code>{}</code></h3><p>{}: {}{}.{}</p>", xml_escaped(words_of(e.id)), xml_escaped(e.id),
        xml_escaped(meaning),
        e.differs ? "differs between the groups" : "no difference that these data make sure",
        e.gain > 0
            ? fmt::format(" (log odds {} of strengths of their own; equal strengths would differ so with "
                          "probability {})",
                          brief(e.gain), e.chance < 1e-4 ? "below 0.0001" : brief(e.chance, 2))
            : std::string(),
        e.possible
            ? ""
            : " <b>Its strengths are beyond what this effect can be</b>: it stands for something else."));
    page.chart(bars(rows, e.unit == "1" ? "" : " " + e.unit, e.id + " by group"));
  }
  page.section("What these recordings cannot tell");
  page.list(c.limits);
  origin_section(page, origin, robot);
  std::vector<std::vector<std::string>> rows;
  for (const ComparedGroup& g : c.groups)
    rows.push_back({xml_escaped(g.name), std::to_string(g.missions), std::to_string(g.samples)});
  const std::vector<std::string> header{"Group", "missions", "samples"};
  page.table(header, rows, 1);
  return page.str();
}

}  // namespace joulecast::gap
