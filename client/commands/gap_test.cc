#include "client/commands/gap_test.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/print.h"
#include "energy/back_test_json.h"
#include "telemetry/recording_set.h"

namespace joulecast::client {
namespace {

double as_percent(double share) {
  return 100 * share;
}

}  // namespace

std::string GapTest::objection() const {
  if (!replayed.improves()) return "the back-test shows no improvement";
  if (!beside_regression || !beside_regression->regression_wins()) return {};
  const energy::MissedPower& missed = beside_regression->missed;
  return fmt::format(
      "power error on the missions of --test: corrected file {:.1f} %, plain regression on the missions of "
      "the "
      "diagnosis {:.1f} %",
      as_percent(missed.corrected), as_percent(missed.regression));
}

Result<GapTest> test_on_other_missions(const std::vector<std::string>& logs, const std::string& robot_id,
                                       std::span<const telemetry::Recording> diagnosed,
                                       const robot::RobotModel& robot, const robot::RobotModel& corrected) {
  TRY_ASSIGN(const auto others, telemetry::load_recordings(logs, robot_id));
  for (const telemetry::Recording& mission : others.missions) {
    const auto same = [&](const telemetry::Recording& d) {
      return d.mission_id == mission.mission_id && !d.samples.empty() && !mission.samples.empty() &&
             d.samples.front().utime_us == mission.samples.front().utime_us;
    };
    if (std::ranges::any_of(diagnosed, same))
      return invalid("--test",
                     "mission " + mission.mission_id +
                         " is one of the diagnosis; a test needs missions that were not used in it");
  }
  std::vector<energy::DriveRun> runs;
  for (const telemetry::Recording& mission : others.missions)
    runs.push_back(
        {mission.mission_id, mission.samples, std::isfinite(mission.payload_kg) ? mission.payload_kg : 0});
  TRY_ASSIGN(auto replayed, energy::back_test(runs, robot, corrected));
  return GapTest{std::move(replayed),
                 energy::compare_with_regression(diagnosed, others.missions, robot, corrected)};
}

nlohmann::ordered_json to_json(const GapTest& test) {
  nlohmann::ordered_json document = energy::back_test_to_json(test.replayed);
  document["beside_regression"] = nullptr;
  if (const auto& beside = test.beside_regression) {
    const energy::MissedPower& missed = beside->missed;
    document["beside_regression"] = {{"windows", beside->windows},
                                     {"file_missed", json_number(missed.file)},
                                     {"corrected_missed", json_number(missed.corrected)},
                                     {"regression_missed", json_number(missed.regression)},
                                     {"regression_wins", beside->regression_wins()}};
  }
  return document;
}

void print(const GapTest& test, const std::string& unit) {
  print_back_test(energy::back_test_to_json(test.replayed), unit);
  if (!test.beside_regression)
    return fmt::print("not compared with a plain regression: {}\n", describe(test.beside_regression.error()));
  const energy::MissedPower& missed = test.beside_regression->missed;
  fmt::print(
      "power error in windows with new readings: robot file {:.1f} %, corrected {:.1f} %, plain regression "
      "on "
      "the missions of the diagnosis {:.1f} %\n",
      as_percent(missed.file), as_percent(missed.corrected), as_percent(missed.regression));
}

}  // namespace joulecast::client
