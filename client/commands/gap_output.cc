#include "client/commands/gap_output.h"

#include <fmt/format.h>

#include <cstdio>
#include <ctime>
#include <filesystem>

#include "client/files.h"
#include "gap/adopt.h"
#include "robot/robot_file.h"

namespace joulecast::client {

void print_effect(const gap::DiagnosedEffect& e) {
  std::printf("  %s: probability %.2f, closes %.0f %% of the gap\n", e.id.c_str(), e.probability,
              100 * e.share);
  for (const auto& p : e.parameters) {
    const std::string unit = p.unit == "1" ? "" : " " + p.unit;
    if (p.deviation >= 0) {
      std::printf("    %s = %.4g +- %.2g%s\n", p.name.c_str(), p.value, p.deviation, unit.c_str());
    } else {
      std::printf("    %s = %.4g%s\n", p.name.c_str(), p.value, unit.c_str());
    }
  }
  for (const auto& other : e.alternatives) std::printf("    cannot be told from %s\n", other.c_str());
}

Exit write_adopted(std::span<const robot::AdoptedEffect> found, robot::RobotModel robot,
                   const std::string& path) {
  const auto extended = gap::with_effects(std::move(robot), found);
  return extended ? write_robot(*extended, path) : report(extended.error());
}

Exit write_robot(const robot::RobotModel& robot, const std::string& path) {
  const auto written = write_file(path, robot::to_json_text(robot) + '\n');
  return written ? Exit::ok : report(written.error());
}

gap::ReportOrigin report_origin(const std::vector<std::string>& sources, const std::string& robot_file) {
  gap::ReportOrigin origin;
  for (const std::string& source : sources)
    origin.sources.push_back(std::filesystem::path(source).filename().string());
  origin.model = std::filesystem::path(robot_file).filename().string();
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  origin.made_at = fmt::format("{:04}-{:02}-{:02} {:02}:{:02}", utc.tm_year + 1900, utc.tm_mon + 1,
                               utc.tm_mday, utc.tm_hour, utc.tm_min);
  origin.software = "joulecast " JOULECAST_VERSION;
  return origin;
}

}  // namespace joulecast::client
