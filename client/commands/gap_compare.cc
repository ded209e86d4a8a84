#include "client/commands/gap_compare.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "client/files.h"
#include "client/progress.h"
#include "gap/compare.h"

namespace joulecast::client {
namespace {

void print(const gap::Comparison& c) {
  std::printf("%s: %zu groups", c.robot_id.c_str(), c.groups.size());
  for (const gap::ComparedGroup& g : c.groups)
    std::printf("%s %s (%zu missions, %zu samples)", &g == &c.groups.front() ? ":" : ",", g.name.c_str(),
                g.missions, g.samples);
  std::printf("\nalike in all groups:");
  for (const std::string& id : c.common) std::printf(" %s", id.c_str());
  std::printf("%s\n", c.common.empty() ? " nothing" : "");
  for (const gap::ComparedEffect& e : c.effects) {
    std::printf("%s %s\n", e.id.c_str(),
                e.differs    ? "differs between the groups"
                : e.gain > 0 ? "may differ between the groups"
                             : "is the same, as far as these data tell");
    for (std::size_t g = 0; g < e.groups.size(); ++g) {
      const std::string unit = e.unit == "1" ? "" : " " + e.unit;
      std::printf("  %-14s %s = %.4g", c.groups[g].name.c_str(), e.parameter.c_str(), e.groups[g].value);
      if (std::isfinite(e.groups[g].deviation)) std::printf(" +- %.2g", e.groups[g].deviation);
      std::printf("%s\n", unit.c_str());
    }
    if (!e.possible)
      std::printf("  beyond what this effect can be: it stands for something else of the same kind\n");
    std::printf("  log odds %+.1f of strengths of their own; chance that equal ones differ so %.2g\n", e.gain,
                e.chance);
  }
  std::printf("limits:\n");
  for (const std::string& limit : c.limits) std::printf("  - %s\n", limit.c_str());
}

}  // namespace

Exit gap_between_groups(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                        const std::string& by, bool json, const std::string& report_file,
                        const gap::ReportOrigin& origin) {
  std::vector<std::string> groups;
  for (const auto& mission : recordings.missions) {
    groups.push_back(
        gap::group_of(mission.mission_id, by == "suffix" ? gap::GroupBy::suffix : gap::GroupBy::prefix));
  }
  const auto comparison = [&] {
    Progress progress("comparing", "%", 100);
    return gap::compare_groups(recordings, groups, robot, progress.shares());
  }();
  if (!comparison) return report(comparison.error());
  if (json) {
    std::printf("%s\n", gap::to_json(*comparison).dump(2).c_str());
  } else {
    print(*comparison);
  }
  if (report_file.empty()) return Exit::ok;
  const auto written = write_file(report_file, gap::report_html(*comparison, robot, origin));
  return written ? Exit::ok : report(written.error());
}

}  // namespace joulecast::client
