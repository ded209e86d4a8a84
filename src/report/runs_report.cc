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

std::string sentence_of(const RunDiagnosis& r) {
  const Diagnosis& d = r.diagnosis;
  std::vector<std::string> names;
  for (const DiagnosedEffect& e : d.effects) names.push_back(words_of(e.id));
  std::string text = fmt::format(
      "Over {} runs the model's error in the energy of a run is {} on average; the verdict is {}.",
      d.missions, percent(d.power_absolute_relative), words_of(name_of(d.verdict)));
  if (!names.empty()) text += fmt::format(" Found: {}.", enumerate(names));
  return text;
}

void runs_section(Page& page, const RunDiagnosis& r) {
  constexpr std::size_t most_runs = 60;
  page.section("Run by run",
               "How far the model is from the measured energy (measured less modelled, of the measured): as "
               "it is, and "
               "with causes named and fitted without that run.");
  std::vector<ChangeRow> rows;
  for (const JudgedRun& run : r.runs) {
    const double measured = run.run.measured_j();
    rows.push_back({(run.run.table.empty() ? "" : run.run.table + ": ") + run.run.name,
                    100 * (1 - run.model_j / measured), 100 * (1 - run.held_out_j / measured)});
    if (rows.size() == most_runs) break;
  }
  const std::vector<std::pair<std::string, std::string>> legend{{"before", "model as it is"},
                                                                {"after", "with causes, run left out"}};
  page.legend(legend);
  page.chart(changes(rows, "error of the modelled energy, % of the measured", "error of each run"),
             r.runs.size() > rows.size() ? "The first 60 runs." : "");
}

void conditions_section(Page& page, const RunDiagnosis& r) {
  if (r.conditions.empty()) return;
  page.section("Conditions left out",
               "Everything is done again without the runs of one condition, which are then predicted; a "
               "plain regression "
               "of energy on distance, time and payload does the same.");
  std::vector<std::vector<std::string>> rows;
  for (const LeftOut& l : r.conditions) {
    std::vector<std::string> names;
    for (const std::string& id : l.effects) names.push_back(words_of(id));
    rows.push_back({xml_escaped(l.what), std::to_string(l.runs), percent(l.before), percent(l.after),
                    percent(l.referee), names.empty() ? "nothing" : xml_escaped(enumerate(names))});
  }
  const std::vector<std::string> header{"Left out",    "runs",       "model as it is",
                                        "with causes", "regression", "named"};
  page.table(header, rows, 1);
}

}  // namespace

std::string report_html(const RunDiagnosis& r, const robot::RobotModel& robot, const ReportOrigin& origin) {
  const Diagnosis& d = r.diagnosis;
  Page page("Why the energy of robot " + d.robot_id + " differs from its model",
            "Diagnosis from energies of runs", sentence_of(r));
  const std::vector<Page::Figure> figures{
      {percent(d.power_absolute_relative), "mean error of a run, model as it is"},
      {percent(r.scatter), "by which runs scatter without a cause"},
      {probability_text(d.verdict_probability), "probability of the verdict"}};
  page.figures(figures);
  page.list(d.reasons);
  effects_section(page, d.effects);
  adoption_section(page, d);
  held_out_section(page, d);
  runs_section(page, r);
  conditions_section(page, r);
  page.section("What these energies do not show");
  page.list(r.limits);
  origin_section(page, origin, robot);
  return page.str();
}

}  // namespace joulecast::report
