#include <fmt/format.h>

#include <cmath>

#include "base/xml_text.h"
#include "gap/chart.h"
#include "gap/report_page.h"

namespace joulecast::gap {
namespace {

std::string sentence_of(const MissionDiagnosis& d) {
  const std::string gap =
      fmt::format("the model misses the energy of a run by {} on average", percent(d.error));
  const std::string fall =
      fmt::format(" On runs that were left out of the fit the error falls from {} to {}.",
                  percent(d.left_out.before), percent(d.left_out.after));
  std::vector<std::string> names;
  for (const DiagnosedEffect& e : d.effects) {
    std::string other;
    if (e.alternatives.size() == 1) other = fmt::format(" (or {})", words_of(e.alternatives.front()));
    if (e.alternatives.size() > 1)
      other = fmt::format(" (or one of {} others that do the same here)", e.alternatives.size());
    names.push_back(words_of(e.id) + other);
  }
  switch (d.verdict) {
    case Verdict::effects:
      return fmt::format("Over {} runs {}; {} {} it.{}", d.runs.size(), gap, enumerate(names),
                         names.size() == 1 ? "explains" : "explain", fall);
    case Verdict::none:
      return fmt::format(
          "Over {} runs {}. That is no more than runs and tables scatter: nothing is missing that "
          "these energies could show.",
          d.runs.size(), gap);
    case Verdict::outside:
      return fmt::format("Over {} runs {}. Something follows {} that no effect of the catalogue explains.",
                         d.runs.size(), gap, words_of(d.outside));
    case Verdict::inconclusive:
      break;
  }
  return fmt::format("Over {} runs {}. These energies do not decide what causes it{}.", d.runs.size(), gap,
                     names.empty() ? "" : "; likeliest: " + enumerate(names));
}

std::vector<std::string> row_of(const LeftOut& l, const std::string& named) {
  return {xml_escaped(l.what),
          std::to_string(l.runs),
          percent(l.before),
          percent(l.after),
          l.before > 0 ? fmt::format("{} [{}, {}]", percent(1 - l.after / l.before, 2),
                                     percent(l.interval[0], 2), percent(l.interval[1], 2))
                       : "–",
          xml_escaped(named)};
}

std::string names_of(const std::vector<std::string>& ids) {
  std::vector<std::string> names;
  for (const std::string& id : ids) names.push_back(words_of(id));
  return names.empty() ? "nothing" : enumerate(names);
}

}  // namespace

std::string report_html(const MissionDiagnosis& d, const robot::RobotModel& robot,
                        const ReportOrigin& origin) {
  Page page("Why robot " + d.robot_id + " spends other energies than its model says",
            "Sim-to-real gap from energies of whole runs", sentence_of(d));
  const std::vector<Page::Figure> figures{
      {percent(d.left_out.before), "mean error of a run, model as it is"},
      {percent(d.left_out.after), "with the effects, on runs left out"},
      {percent(d.scatter), "that scatter from run to run alone makes"},
      {probability_text(d.verdict_probability),
       "probability of the verdict \"" + std::string(name_of(d.verdict)) + "\""}};
  page.figures(figures);
  effects_section(page, d.effects, {});

  page.section(
      "Run by run",
      "How far the model is from the measured energy (measured less modelled, of the measured): as it is, "
      "and with effects named and fitted without that run.");
  std::vector<ChangeRow> rows;
  for (const JudgedRun& r : d.runs) {
    const double measured = r.run.measured_j();
    rows.push_back({(r.run.table.empty() ? "" : r.run.table + ": ") + r.run.label,
                    100 * (measured - r.model_j) / measured, 100 * (measured - r.held_out_j) / measured});
    if (rows.size() >= 60) break;
  }
  const std::vector<std::pair<std::string, std::string>> legend{{"before", "model as it is"},
                                                                {"after", "with effects, run left out"}};
  page.legend(legend);
  page.chart(changes(rows, "energy that the model misses, % of the measured", "error of each run"),
             d.runs.size() > rows.size() ? "The first 60 runs." : "");

  page.section(
      "How far the error falls on runs left out",
      "Everything, the choice of effects included, is done again without the runs that are then predicted. "
      "Intervals: 95 %, bootstrap over runs.");
  std::vector<std::vector<std::string>> left{
      row_of(d.left_out, fmt::format("the same in {} of {} fits", d.folds_agreeing, d.folds))};
  for (const LeftOut& l : d.conditions) left.push_back(row_of(l, names_of(l.effects)));
  const std::vector<std::string> header{"Left out", "runs",     "error before",
                                        "after",    "falls by", "named without them"};
  page.table(header, left, 1);
  if (d.turning) {
    const TurningTerm& t = *d.turning;
    page.section(
        "The turning term of the wheel speeds",
        "Wheel speeds computed as (2v ± l·yaw)/(2r), with l half the track, have half the right turning "
        "term.");
    page.paragraph(fmt::format(
        "In the {} turning runs this would shift energy between the sides by {} of a run's energy and change "
        "their sum by {}. The measured differences between the sides hold {} of that shift: 1 would be a "
        "halved "
        "term, 0 a right one. With the whole term the mean error of single motors goes from {} to {}.",
        t.runs, percent(t.side_difference), percent(t.sum),
        xml_escaped(with_deviation(t.share, t.share_sd, "1")), percent(t.motor_error_before),
        percent(t.motor_error_after)));
  }
  page.section("What these energies cannot tell");
  page.list(d.limits);
  if (!d.not_visible.empty()) {
    std::vector<std::string> names;
    for (const std::string& id : d.not_visible) names.push_back(words_of(id));
    page.paragraph("Nothing is said of " + xml_escaped(enumerate(names)) +
                   ": they move none of these energies.");
  }
  page.section("Method");
  const std::vector<std::string> method{
      "Every effect of the catalogue gives one column: how much it changes the energy of each run, by "
      "integrating "
      "the robot's drive model over a trapezoidal run under the stated conditions.",
      fmt::format(
          "Runs scatter ({} estimated), sides scatter against each other ({}), tables shift against each "
          "other ({}; beforehand about 2 %), and model and meter share a common scale error of 1 %. All of "
          "these are integrated out, so that ordinary scatter is no effect.",
          percent(d.scatters.run), percent(d.scatters.difference), percent(d.scatters.table)),
      "Sets of up to three effects are compared by their evidence, strengths within the catalogue's bounds. "
      "Trends "
      "over payload, speed, acceleration, distance and turning stand for what the catalogue does not know.",
      d.model_given
          ? std::string("The model's energies are those of the table; the robot file gives only how "
                        "effects change them.")
          : std::string("The model's energies are those of the robot file under the stated conditions.")};
  page.list(method);
  origin_section(page, origin, robot);
  std::vector<std::vector<std::string>> runs;
  for (const JudgedRun& r : d.runs) {
    const RunConditions& at = r.run.at;
    runs.push_back({xml_escaped(r.run.label), xml_escaped(r.run.table), brief(at.distance_m),
                    brief(at.speed_m_s), brief(at.acceleration_m_s2), brief(at.payload_kg),
                    at.turn_rad == 0 ? "straight"
                                     : fmt::format("{}° {}", brief(std::fabs(at.turn_rad) * 57.29578),
                                                   at.turn_rad > 0 ? "left" : "right"),
                    brief(r.run.measured_j(), 4), brief(r.model_j, 4), brief(r.held_out_j, 4)});
    if (runs.size() >= 200) break;
  }
  const std::vector<std::string> columns{"Run",        "table", "m",          "m/s",     "m/s²",
                                         "payload kg", "turn",  "measured J", "model J", "left out J"};
  page.table(columns, runs, 2);
  return page.str();
}

}  // namespace joulecast::gap
