#include <string>

#include "fuzz.h"
#include "gap/runs/run_table.h"
#include "robot/robot_file.h"

using namespace joulecast;

// A table of runs, once, and twice under two names.
JOULECAST_FUZZ_TARGET(runs) {
  static const robot::RobotModel robot =
      robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/amr.json").value();
  const gap::RunFile file{"a.csv", std::string(testing::as_text(data, size))};
  const auto one = gap::read_runs({&file, 1}, robot);
  if (one) testing::require(one->runs.size() >= 3);
  if (one) (void)one->groups_by("table");
  const gap::RunFile both[] = {file, {"b.csv", file.text}};
  const auto two = gap::read_runs(both, robot);
  if (one && two) testing::require(two->runs.size() == 2 * one->runs.size());
}
