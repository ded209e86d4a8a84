#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/try.h"
#include "client/commands/gap_output.h"
#include "client/commands/gap_parts.h"
#include "client/commands/print.h"
#include "client/progress.h"
#include "client/wrapped.h"
#include "gap/groups/comparison_json.h"

namespace joulecast::client {
namespace {

std::string signed_per_way(double joules_per_m, const std::string& unit) {
  return (joules_per_m < 0 ? "" : "+") + energy_per_way_text(joules_per_m, unit);
}

void print_comparison_rest(const gap::Comparison& c, const std::string& unit) {
  fmt::print("groups:\n");
  for (const gap::ComparedGroup& g : c.groups) {
    fmt::print("  {:<14} {}, {:.4g} m", g.name, count_of(g.missions, "mission"), g.way_m);
    if (std::isfinite(g.energy_per_m_j))
      fmt::print(": {}, by the model with the common effects {}", energy_per_way_text(g.energy_per_m_j, unit),
                 energy_per_way_text(g.model_per_m_j, unit));
    fmt::print("\n");
  }
  for (const gap::ComparedEffect& e : c.effects) {
    fmt::print("{} {} above the group where it is weakest:\n", e.id, e.parameter);
    for (const gap::GroupStrength& s : e.groups) {
      fmt::print("  {:<14} {:.4g} ± {:.2g}{}", s.group, s.value, s.deviation,
                 e.unit == "1" ? "" : " " + e.unit);
      if (std::isfinite(s.energy_per_m_j)) fmt::print(" ({})", signed_per_way(s.energy_per_m_j, unit));
      fmt::print("\n");
    }
  }
  if (c.difference) {
    const gap::GroupDifference& d = *c.difference;
    fmt::print("{} takes {} more than {}: {} by motion and load", d.to,
               energy_per_way_text(d.energy_per_m_j, unit), d.from, signed_per_way(d.by_motion_j, unit));
    for (const auto& [id, joules] : d.by_effect_j) fmt::print(", {} by {}", signed_per_way(joules, unit), id);
    fmt::print(", {} unexplained\n", signed_per_way(d.unexplained_j, unit));
  }
  fmt::print("effects common to all groups:");
  for (const std::string& id : c.common) fmt::print(" {}", id);
  fmt::print("{}\nlimits:\n", c.common.empty() ? " nothing" : "");
  for (const std::string& limit : c.limits) fmt::print("  - {}\n", wrapped(limit, help_width(), 4));
}

}  // namespace

Result<Exit> compare_and_print(const std::function<Result<gap::Comparison>(const gap::Progress&)>& compare,
                               const robot::RobotModel& robot, const GapOptions& options,
                               const report::ReportOrigin& origin) {
  const auto compared = [&] {
    Progress progress("comparing", "%", 100);
    return compare(progress.shares());
  };
  TRY_ASSIGN(const auto comparison, compared());
  const nlohmann::ordered_json document = gap::comparison_to_json(comparison);
  if (options.json) {
    fmt::print("{}\n", document.dump(2));
  } else {
    print_diagnosis(document);
    print_comparison_rest(comparison, options.unit);
  }
  if (!options.report.empty()) TRY(write_page(options, report::report_html(document, robot, origin)));
  return Exit::ok;
}

Result<Exit> gap_between_groups(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                                const GapOptions& options, const report::ReportOrigin& origin) {
  TRY_ASSIGN(const auto groups, gap::groups_of(recordings, options.compare_by));
  return compare_and_print(
      [&](const gap::Progress& progress) {
        return gap::compare_recordings(recordings, groups, robot, progress);
      },
      robot, options, origin);
}

}  // namespace joulecast::client
