#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "plausibility/check.h"
#include "robot/robot_file.h"
#include "tests/support/import_csv.h"
#include "tests/support/shared_folder.h"

// Recordings of real robots.
namespace joulecast::plausibility {
namespace {

namespace fs = std::filesystem;

const fs::path data = JOULECAST_SHARED "/data";
const fs::path robots = JOULECAST_SOURCE_DIR "/deploy/robots";

std::string text_of(const fs::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

const Check* find_in_real(const std::vector<Check>& checks, std::string_view id) {
  const auto at = std::ranges::find(checks, id, &Check::id);
  return at == checks.end() ? nullptr : &*at;
}

telemetry::RecordingSet imported(const std::vector<fs::path>& tables, const std::string& mapping) {
  std::vector<telemetry::Recording> missions;
  std::int64_t start = 1'700'000'000'000'000;
  for (const fs::path& table : tables) {
    const auto import = telemetry::import_csv(text_of(table), *telemetry::ImportMapping::parse(mapping),
                                              {.source_name = table.string(),
                                               .robot_id = {},
                                               .mission_id = {},
                                               .start_utime_us = start += 600'000'000});
    if (import) missions.push_back(import->recording);
  }
  return *telemetry::make_recording_set("imported", std::move(missions));
}

std::vector<fs::path> tables_in(const fs::path& folder, std::string_view ending) {
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().string().ends_with(ending)) found.push_back(entry.path());
  }
  std::ranges::sort(found);
  return found;
}

// The left current is negative in turns in which the ground drives the inner left wheel.
TEST(Warthog, AcceptsNegativeInnerCurrent) {
  const fs::path folder = data / "real/warthog_grass";
  JOULECAST_NEED_SHARED(fs::exists(folder), "recordings " << folder);
  const auto robot = robot::load_robot(robots / "warthog-grass.json");
  ASSERT_TRUE(robot);
  std::string mapping = text_of(JOULECAST_SOURCE_DIR "/deploy/import/warthog_grass.json");
  const std::string sides =
      R"("motor_current": [{"column": "right_wheel_current"}, {"column": "left_wheel_current"}],
                               "motor_voltage": [{"column": "right_wheel_voltage"}, {"column": "left_wheel_voltage"}],)";
  const auto fields = mapping.find("\"fields\": {") + 11;
  mapping.insert(fields, sides);
  const auto checks = check_recordings(imported(tables_in(folder, ".csv"), mapping), *robot);
  for (const Check& c : checks) EXPECT_EQ(c.id.find("reversed"), std::string::npos) << c.says;
  ASSERT_TRUE(find_in_real(checks, "supply_for_motor_voltage"));
  ASSERT_TRUE(find_in_real(checks, "held_samples"));
  EXPECT_NEAR(find_in_real(checks, "held_samples")->value, 1.0, 0.1);
}

TEST(Frc, ReportsFileOfOtherGear) {
  const fs::path folder = data / "real/frc3314_drivetrain";
  JOULECAST_NEED_SHARED(fs::exists(folder), "recordings " << folder);
  const auto set = imported(tables_in(folder, "_low.csv"),
                            text_of(JOULECAST_SOURCE_DIR "/deploy/import/frc3314_low.json"));
  const auto checks = check_recordings(set, *robot::load_robot(robots / "frc3314-high.json"));
  for (const Check& c : checks) EXPECT_FALSE(c.contradicted) << c.says;
  ASSERT_TRUE(find_in_real(checks, "robot_file"));
  EXPECT_NE(find_in_real(checks, "robot_file")->says.find("voltage constant"), std::string::npos);
}

// The robot file contains neither scrub nor rolling resistance. Driving still consumes power.
TEST(Husky, FindsReversedCurrentPerMission) {
  const fs::path folder = data / "real/borealtc_husky/ICE";
  JOULECAST_NEED_SHARED(fs::exists(folder), "recordings " << folder);
  const auto robot = robot::load_robot(robots / "borealtc-husky.json");
  const auto recorded =
      imported(tables_in(folder, ".csv"), text_of(JOULECAST_SOURCE_DIR "/deploy/import/borealtc_husky.json"));
  for (const bool wrong : {false, true}) {
    auto set = recorded;
    for (auto& mission : set.missions) {
      for (auto& s : mission.samples) {
        // The battery is not recorded: a battery of 24 V supplies both motors' currents.
        const double amps = std::fabs(s.motor_current_a[0]) + std::fabs(s.motor_current_a[1]);
        s.battery_voltage_v = 24;
        s.battery_current_a = wrong ? -amps : amps;
        s.motor_current_a = {signals::unmeasured, signals::unmeasured};
      }
    }
    const auto checks = check_recordings(set, *robot);
    EXPECT_EQ(std::ranges::any_of(checks, &Check::contradicted), wrong);
    const Check* reversed = find_in_real(checks, "battery_current_reversed");
    ASSERT_EQ(reversed != nullptr, wrong);
    if (reversed != nullptr) {
      EXPECT_TRUE(reversed->few_missions.empty());
    }
  }
}

// The drives are too short to estimate the resistance of each motor separately.
TEST(Frc, FindsMotorFaultFromSibling) {
  const fs::path folder = data / "real/frc3314_drivetrain";
  JOULECAST_NEED_SHARED(fs::exists(folder), "recordings " << folder);
  const auto robot = robot::load_robot(robots / "frc3314-low.json");
  const auto checked = [&](std::size_t side, double factor) {
    auto set = imported(tables_in(folder, "_low.csv"),
                        text_of(JOULECAST_SOURCE_DIR "/deploy/import/frc3314_low.json"));
    for (auto& mission : set.missions) {
      for (auto& s : mission.samples) s.motor_current_a[side] *= factor;
    }
    return check_recordings(set, *robot);
  };
  const auto reversed = checked(0, -1);
  ASSERT_TRUE(find_in_real(reversed, "motor_current_reversed"));
  EXPECT_EQ(find_in_real(reversed, "motor_current_reversed")->channel, "motor_current.right");
  const auto weak = checked(1, 1.0 / 3);
  ASSERT_TRUE(find_in_real(weak, "motor_against_sibling"));
  EXPECT_NEAR(find_in_real(weak, "motor_against_sibling")->value, 3, 1);
  EXPECT_FALSE(find_in_real(checked(0, 1), "motor_against_sibling"));
}

}  // namespace
}  // namespace joulecast::plausibility
