#include <nlohmann/json.hpp>

#include "base/try.h"
#include "client/commands/gap_output.h"
#include "client/progress.h"
#include "gap/groups/comparison_json.h"

namespace joulecast::client {

Result<Exit> compare_and_print(const std::function<Result<gap::Comparison>(const gap::Progress&)>& compare,
                               const robot::RobotModel& robot, const GapOptions& options,
                               const report::ReportOrigin& origin) {
  TRY_ASSIGN(const auto comparison, with_progress("comparing", compare));
  const nlohmann::ordered_json document = gap::comparison_to_json(comparison);
  show_diagnosis(options, document);
  TRY(write_page(options, document, robot, origin));
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
