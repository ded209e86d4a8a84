#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "signals/ids.h"
#include "telemetry/codec.h"
#include "telemetry/csv_table.h"
#include "telemetry/recording.h"
#include "telemetry/validation.h"
#include "temporary_file.h"
#include "tests/support/import_csv.h"
#include "tests/support/shared_folder.h"

// The shipped mapping files, applied to the recordings for which they were written.
namespace joulecast::telemetry {
namespace {

namespace fs = std::filesystem;

const fs::path real_data = JOULECAST_SHARED "/data/real";
const std::string frc_prefix = "network_table:///SmartDashboard/";

ImportMapping shipped(const std::string& name) {
  auto mapping =
      ImportMapping::parse(test::read_text(fs::path(JOULECAST_SOURCE_DIR "/deploy/import") / name));
  EXPECT_TRUE(mapping) << describe(mapping.error());
  return mapping.value();
}

Result<Import> import_file(const fs::path& path, const std::string& mapping) {
  ImportOptions options;
  options.source_name = path.string();
  options.start_utime_us = 1'700'000'000'000'000;
  return import_csv(test::read_text(path), shipped(mapping), options);
}

std::vector<fs::path> tables_in(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code none;
  for (const auto& entry : fs::recursive_directory_iterator(folder, none)) {
    if (entry.path().extension() == ".csv") found.push_back(entry.path());
  }
  return found;
}

// Column `name` of a table with empty cells filled from above, as numbers.
std::vector<double> column(const std::string& csv, const std::string& name) {
  CsvTable table = CsvTable::open(csv, ',').value();
  const auto found = std::ranges::find(table.header(), name);
  const auto place = static_cast<std::size_t>(found - table.header().begin());
  std::vector<double> values;
  std::vector<std::string_view> row;
  double held = signals::unmeasured;
  while (table.next(row).value()) {
    if (!row[place].empty()) held = std::stod(std::string(row[place]));
    values.push_back(held);
  }
  return values;
}

TEST(ShippedMappings, EveryOneParses) {
  for (const auto& entry : fs::directory_iterator(JOULECAST_SOURCE_DIR "/deploy/import")) {
    if (entry.path().extension() != ".json") continue;
    EXPECT_TRUE(ImportMapping::parse(test::read_text(entry.path()))) << entry.path();
  }
}

TEST(ImportFrc3314, EachRecordingGivesOneMission) {
  const auto tables = tables_in(real_data / "frc3314_drivetrain");
  JOULECAST_NEED_SHARED(!tables.empty(), "frc3314_drivetrain recordings");
  for (const fs::path& path : tables) {
    SCOPED_TRACE(path.filename().string());
    const bool high = path.stem().string().ends_with("high");
    const auto import = import_file(path, high ? "frc3314_high.json" : "frc3314_low.json");
    ASSERT_TRUE(import) << describe(import.error());
    EXPECT_EQ(import->recording.robot_id, high ? "frc3314-high" : "frc3314-low");
    EXPECT_EQ(import->recording.mission_id, path.stem().string());
    EXPECT_EQ(import->report.samples, import->report.rows);
    for (const signals::Sample& sample : import->recording.samples) {
      const auto fault = check_plausible(sample);
      ASSERT_FALSE(fault) << describe(*fault);
      EXPECT_TRUE(std::isnan(sample.battery_voltage_v));
      EXPECT_TRUE(std::isnan(sample.battery_current_a));
    }
    EXPECT_FALSE(import_file(path, high ? "frc3314_low.json" : "frc3314_high.json"))
        << "the wrong gear was accepted";
  }
}

// Compares the velocity that the mapping derives from "Speed Inches" with positions that it does not use: the
// encoder's ticks, 42 per motor revolution, and the travel per revolution from the recordings' notes. Both
// sides must roll in the same direction.
TEST(ImportFrc3314, IntegratedSpeedMatchesEncoderTicks) {
  const auto tables = tables_in(real_data / "frc3314_drivetrain");
  JOULECAST_NEED_SHARED(!tables.empty(), "frc3314_drivetrain recordings");
  constexpr double wheel_radius_in = 6.125 / 2;
  for (const fs::path& path : tables) {
    SCOPED_TRACE(path.filename().string());
    const bool high = path.stem().string().ends_with("high");
    const bool forward = path.stem().string().find("forward") != std::string::npos;
    const auto import = import_file(path, high ? "frc3314_high.json" : "frc3314_low.json");
    ASSERT_TRUE(import);
    const std::string csv = test::read_text(path);
    const double tick_in = (high ? 3.5781 : 1.2245) / 42;
    const auto& samples = import->recording.samples;
    for (const std::size_t side : {0u, 1u}) {
      const auto ticks =
          column(csv, frc_prefix + (side == 0 ? "Right" : "Left") + " NEO Encoder Position Ticks");
      ASSERT_EQ(ticks.size(), samples.size());
      double travelled_in = 0;
      double counted_in = 0;
      double fastest = 0;
      for (std::size_t i = 1; i < samples.size(); ++i) {
        const double dt_s = static_cast<double>(samples[i].utime_us - samples[i - 1].utime_us) * 1e-6;
        const double speed_rad_s =
            (samples[i].wheel_velocity_rad_s[side] + samples[i - 1].wheel_velocity_rad_s[side]) / 2;
        const double step_in = std::abs(ticks[i] - ticks[i - 1]) * tick_in;
        fastest = std::max(fastest, std::abs(speed_rad_s));
        // Positions are reset inside the files; such a step is not travel.
        if (step_in > 3 * std::abs(speed_rad_s) * wheel_radius_in * dt_s + 1) continue;
        travelled_in += speed_rad_s * wheel_radius_in * dt_s;
        counted_in += step_in;
      }
      EXPECT_EQ(travelled_in > 0, forward) << "side " << side;
      // Each recording is one ramp or step up and a stop. Trapezoids of 0.1 s are wrong by at most one
      // sample of the top speed at either end, and the ticks are held for up to one sample as well.
      EXPECT_NEAR(std::abs(travelled_in), counted_in,
                  2 * 0.1 * fastest * wheel_radius_in + 0.00005 / 1.2245 * counted_in);
    }
  }
}

// While the motors are driven, current and voltage have the same sign on both sides, and so have the sides.
TEST(ImportFrc3314, DrivenSidesPushForward) {
  const auto tables = tables_in(real_data / "frc3314_drivetrain");
  JOULECAST_NEED_SHARED(!tables.empty(), "frc3314_drivetrain recordings");
  for (const fs::path& path : tables) {
    SCOPED_TRACE(path.filename().string());
    const bool high = path.stem().string().ends_with("high");
    const auto import = import_file(path, high ? "frc3314_high.json" : "frc3314_low.json");
    ASSERT_TRUE(import);
    std::size_t driven = 0;
    for (const signals::Sample& s : import->recording.samples) {
      for (const std::size_t side : {0u, 1u}) {
        EXPECT_GE(s.motor_voltage_v[side] * s.motor_current_a[side], 0);
        if (std::abs(s.motor_voltage_v[side]) < 1 || std::abs(s.wheel_velocity_rad_s[side]) < 1) continue;
        EXPECT_GT(s.motor_voltage_v[side] * s.wheel_velocity_rad_s[side], 0);
        ++driven;
      }
    }
    EXPECT_GT(driven, 20u);
  }
}

TEST(ImportFrc3314, ReportsGlitch) {
  const fs::path path = real_data / "frc3314_drivetrain/step_voltage_forward_high.csv";
  JOULECAST_NEED_SHARED(fs::exists(path), "frc3314_drivetrain recordings");
  const auto import = import_file(path, "frc3314_high.json");
  ASSERT_TRUE(import) << describe(import.error());
  ASSERT_EQ(import->report.glitches.size(), 1u);
  EXPECT_EQ(import->report.glitches[0].column, "Right Slave 1 Current");
  EXPECT_EQ(import->report.glitches[0].value, -62.71875);
  EXPECT_EQ(import->report.glitches[0].action, "hold");
}

TEST(ImportFrc3314, SumsCurrentOfThreeMotors) {
  const fs::path path = real_data / "frc3314_drivetrain/step_voltage_backward_low.csv";
  JOULECAST_NEED_SHARED(fs::exists(path), "frc3314_drivetrain recordings");
  const auto import = import_file(path, "frc3314_low.json");
  ASSERT_TRUE(import);
  const std::string csv = test::read_text(path);
  for (const std::size_t side : {0u, 1u}) {
    const std::string name = frc_prefix + (side == 0 ? "Right" : "Left");
    const auto a = column(csv, name + " Master Current");
    const auto b = column(csv, name + " Slave 1 Current");
    const auto c = column(csv, name + " Slave 2 Current");
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(std::abs(import->recording.samples[i].motor_current_a[side]), a[i] + b[i] + c[i]);
    }
  }
}

TEST(ImportHusky, EveryTableGivesPlausibleSamples) {
  const auto tables = tables_in(real_data / "borealtc_husky");
  JOULECAST_NEED_SHARED(!tables.empty(), "borealtc_husky recordings");
  for (const fs::path& path : tables) {
    SCOPED_TRACE(path.string());
    const auto import = import_file(path, "borealtc_husky.json");
    ASSERT_TRUE(import) << describe(import.error());
    EXPECT_TRUE(signals::is_valid_mission_id(import->recording.mission_id));
    EXPECT_EQ(import->report.samples, import->report.rows);
    EXPECT_TRUE(import->report.glitches.empty());
    for (const signals::Sample& sample : import->recording.samples) {
      ASSERT_FALSE(check_plausible(sample));
      ASSERT_TRUE(std::isnan(sample.battery_voltage_v));
      for (std::size_t side : {0u, 1u})
        ASSERT_GE(sample.motor_current_a[side] * sample.wheel_velocity_rad_s[side], 0);
    }
  }
}

TEST(ImportWarthog, GivesPlausibleSamples) {
  const fs::path path = real_data / "warthog_grass/warthog_wheels_grass_2024-07-18_a.csv";
  JOULECAST_NEED_SHARED(fs::exists(path), "warthog_grass recording");
  ImportOptions options;
  options.source_name = path.string();
  const auto import = import_csv(test::read_text(path), shipped("warthog_grass.json"), options);
  ASSERT_TRUE(import) << describe(import.error());
  EXPECT_EQ(import->report.samples, import->report.rows);
  EXPECT_EQ(import->recording.samples[0].utime_us, 1'721'335'045'320'405);
  std::size_t without_voltage = 0;
  for (const signals::Sample& sample : import->recording.samples) {
    ASSERT_FALSE(check_plausible(sample));
    if (std::isnan(sample.battery_voltage_v)) {
      ++without_voltage;
    } else {
      ASSERT_GT(sample.battery_voltage_v, 40);
    }
  }
  // Only about the first second, before the drives report.
  EXPECT_LT(without_voltage, 100u);
}

// The robot of a mapping that divides speeds by the wheel radius.
dynamics::Parameters<double> wheels_of(double radius_m) {
  dynamics::Parameters<double> parameters;
  parameters.wheel_radius_m = {radius_m, radius_m};
  parameters.half_track_m = 0.5;
  return parameters;
}

// Elevation in steps of a metre at 5 Hz.
TEST(ImportMotives, ClimbFollowsElevationWithoutSpikes) {
  const fs::path folder = real_data / "motives_bev/road";
  JOULECAST_NEED_SHARED(fs::exists(folder), "motives_bev recordings");
  for (const char* trip : {"trip075", "trip085", "trip095"}) {
    SCOPED_TRACE(trip);
    ImportOptions options{trip, {}, {}, 1'700'000'000'000'000};
    const std::string csv = test::read_packed_text(folder / (std::string(trip) + ".csv.gz"));
    const auto import = import_csv(csv, shipped("motives_road.json"), options);
    ASSERT_TRUE(import) << describe(import.error());
    const Recording& recording = import->recording;
    EXPECT_EQ(recording.samples.size(), import->report.rows);
    ASSERT_EQ(recording.covariates.size(), 2u);
    signals::CovariateReader elevation(signals::find_series(recording.covariates, signals::height_covariate));
    const auto climb = climb_of(recording, wheels_of(0.33));
    const auto speed = column(csv, "v_mps");
    double height_m = elevation.at(recording.samples[0].utime_us), steepest = 0, furthest_m = 0, moved_s = 0;
    std::size_t steep = 0;
    for (std::size_t k = 1; k < climb.size(); ++k) {
      const auto& [a, b] = std::pair{recording.samples[k - 1], recording.samples[k]};
      const double interval_s = 1e-6 * static_cast<double>(b.utime_us - a.utime_us);
      ASSERT_TRUE(std::isfinite(climb[k]));
      height_m += std::sin(climb[k]) * speed[k] * interval_s;
      furthest_m = std::max(furthest_m, std::abs(height_m - elevation.at(b.utime_us)));
      steepest = std::max(steepest, std::abs(climb[k]));
      steep += std::abs(climb[k]) > 0.04;
      if (speed[k] > 0) moved_s += interval_s;
    }
    EXPECT_GT(moved_s, 600);
    // The climb is smooth, and its integral is the elevation including the last step.
    EXPECT_LT(steepest, 0.06);
    EXPECT_LT(static_cast<double>(steep), 0.02 * static_cast<double>(climb.size()));
    EXPECT_LT(furthest_m, 3.5);
  }
}

// Of ten rows a second, three have a pitch; a gap of 40 s ends with none.
TEST(RecordingClimb, HoldsSlowPitch) {
  Recording recording;
  for (int k = 0; k < 200; ++k) {
    signals::Sample& sample = recording.samples.emplace_back();
    sample.utime_us = 100'000 * k + (k < 100 ? 0 : 40'000'000);
    sample.sequence = k;
    sample.wheel_velocity_rad_s = {2, 2};
    sample.pitch_rad = k % 3 == 0 ? 0.05 : std::nan("");
  }
  const auto climb = climb_of(recording, wheels_of(0.5));
  ClimbReader reader;
  dynamics::ClimbTracker online;
  for (std::size_t k = 0; k < 200; ++k) {
    const auto step = k == 0 || k == 100 ? signals::Step::gap : signals::Step::bridged;
    const double now = online.add(reader.at(wheels_of(0.5), recording.samples[k], std::nan(""), step));
    const bool known = k != 100 && k != 101;
    EXPECT_EQ(std::isfinite(climb[k]), known) << k;
    EXPECT_EQ(std::isfinite(now), known) << k;
    if (known) {
      EXPECT_EQ(std::pair(climb[k], now), std::pair(0.05, 0.05)) << k;
    }
  }
}

TEST(ImportMotives, DynamometerIsFlat) {
  const fs::path path = real_data / "motives_bev/lab/CLTC_CSS__06_CS_20_1.csv.gz";
  JOULECAST_NEED_SHARED(fs::exists(path), "motives_bev recordings");
  ImportOptions options{path.string(), {}, "m", 1'700'000'000'000'000};
  const auto import = import_csv(test::read_packed_text(path), shipped("motives_lab.json"), options);
  ASSERT_TRUE(import) << describe(import.error());
  for (const double climb : climb_of(import->recording, wheels_of(0.33))) ASSERT_EQ(climb, 0);
  EXPECT_NE(signals::find_series(import->recording.covariates, "auxiliary_a"), nullptr);
}

TEST(ImportEvPino, KeepsRecordedPower) {
  const fs::path path = real_data / "evpino_tesla3/Tesla3_full.csv.gz";
  JOULECAST_NEED_SHARED(fs::exists(path), "evpino_tesla3 recording");
  ImportOptions options{path.string(), {}, "m", 1'700'000'000'000'000};
  const std::string csv = test::read_packed_text(path);
  const auto import = import_csv(csv, shipped("evpino_tesla3.json"), options);
  ASSERT_TRUE(import) << describe(import.error());
  const auto power = column(csv, "BatteryPower");
  ASSERT_EQ(import->recording.samples.size(), power.size());
  for (std::size_t k = 0; k < power.size(); ++k) {
    const signals::Sample& s = import->recording.samples[k];
    ASSERT_NEAR(s.battery_voltage_v * s.battery_current_a, power[k], 1e-6);
    ASSERT_EQ(s.wheel_velocity_rad_s[0], s.wheel_velocity_rad_s[1]);
  }
}

TEST(ImportWarthog, DerivesClimbFromScanHeight) {
  const fs::path path = real_data / "warthog_grass/warthog_wheels_grass_2024-07-18_a.csv";
  JOULECAST_NEED_SHARED(fs::exists(path), "warthog_grass recording");
  ImportOptions options;
  options.source_name = path.string();
  const auto import = import_csv(test::read_text(path), shipped("warthog_grass.json"), options);
  ASSERT_TRUE(import) << describe(import.error());
  double steepest = 0;
  for (const double climb : climb_of(import->recording, wheels_of(0.3)))
    if (std::isfinite(climb)) steepest = std::max(steepest, std::abs(climb));
  EXPECT_GT(steepest, 0.02);
  EXPECT_LT(steepest, 0.15);
}

}  // namespace
}  // namespace joulecast::telemetry
