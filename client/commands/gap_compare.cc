#include "client/commands/gap_compare.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "client/commands/gap_output.h"
#include "client/files.h"
#include "client/progress.h"
#include "client/wrapped.h"
#include "gap/groups/comparison_json.h"

namespace joulecast::client {
namespace {

void print_comparison_rest(const gap::Comparison& c) {
  fmt::print("groups:\n");
  for (const gap::ComparedGroup& g : c.groups) {
    fmt::print("  {:<14} {} missions, {:.4g} m", g.name, g.missions, g.way_m);
    if (std::isfinite(g.energy_per_m_j)) {
      fmt::print(": {:.4g} J/m, by the model with what all share {:.4g} J/m", g.energy_per_m_j,
                 g.model_per_m_j);
    }
    fmt::print("\n");
  }
  for (const gap::ComparedEffect& e : c.effects) {
    fmt::print("{} {} relative to the mean over all groups:\n", e.id, e.parameter);
    for (std::size_t g = 0; g < e.groups.size(); ++g) {
      const gap::GroupStrength& s = e.groups[g];
      fmt::print("  {:<14} {:+.4g} +- {:.2g}{}", c.groups[g].name, s.value, s.deviation,
                 e.unit == "1" ? "" : " " + e.unit);
      if (std::isfinite(s.energy_per_m_j)) fmt::print(" ({:+.3g} J/m)", s.energy_per_m_j);
      fmt::print("\n");
    }
  }
  if (c.difference) {
    const gap::GroupDifference& d = *c.difference;
    fmt::print("{} takes {:.4g} J/m more than {}: {:+.4g} by motion and load", c.groups[d.to].name,
               d.energy_per_m_j, c.groups[d.from].name, d.by_motion_j);
    for (std::size_t k = 0; k < c.effects.size(); ++k)
      fmt::print(", {:+.4g} by {}", d.by_effect_j[k], c.effects[k].id);
    fmt::print(", {:+.4g} unexplained\n", d.unexplained_j);
  }
  fmt::print("alike in all groups:");
  for (const std::string& id : c.common) fmt::print(" {}", id);
  fmt::print("{}\nlimits:\n", c.common.empty() ? " nothing" : "");
  for (const std::string& limit : c.limits) fmt::print("  - {}\n", wrapped(limit, help_width(), 4));
}

}  // namespace

Exit compare_and_print(const std::function<Result<gap::Comparison>(const gap::CompareSettings&)>& compare,
                       const robot::RobotModel& robot, const GapCompareOptions& options,
                       const report::ReportOrigin& origin) {
  const auto comparison = [&] {
    Progress progress("comparing", "%", 100);
    gap::CompareSettings settings;
    settings.progress = progress.shares();
    return compare(settings);
  }();
  if (!comparison) return report(comparison.error());
  const nlohmann::ordered_json document = gap::comparison_to_json(*comparison);
  if (options.json) {
    fmt::print("{}\n", document.dump(2));
  } else {
    print_diagnosis(document);
    print_comparison_rest(*comparison);
  }
  if (options.report.empty()) return Exit::ok;
  const auto written = write_text_file(options.report, report::report_html(document, robot, origin),
                                       existing(options.force));
  return written ? Exit::ok : report(written.error());
}

Exit gap_between_groups(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                        const GapCompareOptions& options, const report::ReportOrigin& origin) {
  const auto groups = gap::groups_of(recordings, options.by);
  if (!groups) return report(groups.error());
  return compare_and_print(
      [&](const gap::CompareSettings& settings) {
        return gap::compare_recordings(recordings, *groups, robot, settings);
      },
      robot, options, origin);
}

}  // namespace joulecast::client
