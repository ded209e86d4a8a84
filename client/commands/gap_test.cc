#include "client/commands/gap_test.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "base/try.h"
#include "energy/back_test_json.h"
#include "telemetry/recording_set.h"

namespace joulecast::client {
namespace {

double as_percent(double share) {
  return 100 * share;
}

void print_fall(const char* what, double before, double after, const std::array<double, 2>& interval) {
  fmt::print("{} {:.2f} % -> {:.2f} %, falls by {:.2f} % [{:.2f}, {:.2f}]\n", what, as_percent(before),
             as_percent(after), as_percent(before - after), as_percent(interval[0]), as_percent(interval[1]));
}

void print(const energy::BackTest& test) {
  fmt::print("{:<24} {:>12} {:>14} {:>14}\n", "tested on mission", "measured J", "error before",
             "error after");
  for (const energy::RunComparison& run : test.runs)
    fmt::print("{:<24} {:>12.2f} {:>12.2f} % {:>12.2f} %\n", run.name, run.measured_j,
               as_percent(run.before.relative), as_percent(run.after.relative));
  print_fall("energy error", test.error_before, test.error_after, test.improvement_interval);
  print_fall("power gap", test.power_gap_before, test.power_gap_after, test.power_gap_fall_interval);
  fmt::print("{}\n", test.improves() ? "it improves" : "no improvement is shown");
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

void print(const GapTest& test) {
  print(test.replayed);
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
