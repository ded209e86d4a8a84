#include <fmt/format.h>

#include "base/xml_text.h"
#include "gap/verdict/words.h"
#include "report/chart.h"
#include "report/quantity.h"
#include "report/report.h"
#include "report/sections.h"

namespace joulecast::report {

using namespace gap;

namespace {

std::string sentence_of(const Comparison& c) {
  std::vector<std::string> groups, names;
  for (const ComparedGroup& g : c.groups) groups.push_back(g.name);
  for (const ComparedEffect& e : c.effects) names.push_back(words_of(e.id));
  return fmt::format("Between {}: {}. The verdict is {}.", enumerate(groups),
                     names.empty() ? "no difference that these data make sure" : enumerate(names) + " differ",
                     words_of(name_of(c.diagnosis.verdict)));
}

void difference_section(Page& page, const Comparison& c) {
  if (!c.difference) return;
  const GroupDifference& d = *c.difference;
  page.section("Where the difference in energy per metre comes from",
               fmt::format("{} above {}; the parts of motion and load are by the model.", c.groups[d.to].name,
                           c.groups[d.from].name));
  std::vector<std::vector<std::string>> rows{{"motion and load", quantity(d.by_motion_j, "J/m")}};
  for (std::size_t k = 0; k < c.effects.size(); ++k)
    rows.push_back({xml_escaped(words_of(c.effects[k].id)), quantity(d.by_effect_j[k], "J/m")});
  rows.push_back({"not explained", quantity(d.unexplained_j, "J/m")});
  rows.push_back({"measured", quantity(d.energy_per_m_j, "J/m")});
  const std::vector<std::string> header{"Part", "of the difference"};
  page.table(header, rows, 1);
}

void strengths_section(Page& page, const Comparison& c) {
  if (c.effects.empty()) return;
  page.section("Strengths by group", "Each with the mean over all groups. Whiskers: 95 %.");
  for (const ComparedEffect& e : c.effects) {
    std::vector<BarRow> rows;
    for (std::size_t g = 0; g < e.groups.size(); ++g) {
      const GroupStrength& s = e.groups[g];
      rows.push_back({c.groups[g].name,
                      with_deviation(s.value, s.deviation, e.unit),
                      s.value,
                      {s.value - 1.96 * s.deviation, s.value + 1.96 * s.deviation},
                      "after"});
    }
    page.chart(bars(rows, e.unit == "1" ? "" : " " + e.unit, e.id + " by group"), words_of(e.id));
  }
}

}  // namespace

std::string report_html(const Comparison& c, const robot::RobotModel& robot, const ReportOrigin& origin) {
  Page page("What changes for robot " + c.diagnosis.robot_id + " between groups of missions",
            "Comparison of groups", sentence_of(c));
  page.list(c.diagnosis.reasons);
  effects_section(page, c.diagnosis.effects);
  difference_section(page, c);
  strengths_section(page, c);
  checks_section(page, c.diagnosis.checks);
  page.section("What these data do not show");
  page.list(c.limits);
  std::vector<std::vector<std::string>> rows;
  for (const ComparedGroup& g : c.groups) {
    rows.push_back({xml_escaped(g.name), std::to_string(g.missions), std::to_string(g.samples),
                    brief(g.way_m), brief(g.energy_per_m_j), brief(g.model_per_m_j)});
  }
  const std::vector<std::string> header{"Group",    "missions", "samples",
                                        "m driven", "J/m",      "J/m by the model"};
  page.table(header, rows, 1);
  origin_section(page, origin, robot);
  return page.str();
}

}  // namespace joulecast::report
