// Errors planted in the telemetry of virtual robots, whose plant shares no physics with the model, each with
// the robot's file and with a file that is wrong.
#include "tests/study/corrections/corrections.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "tests/plausibility/alterations.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::gap {
namespace {

using namespace plausibility::reading;
using telemetry::RecordingSet;
constexpr double rpm = 30 / std::numbers::pi, degrees = 180 / std::numbers::pi;

struct Planted {
  const char* name;
  const char* channel;
  const char* kind;
  double factor;
  std::function<void(RecordingSet&)> plant;
};

Planted times(const char* name, const char* channel, std::initializer_list<std::size_t> readings, double f) {
  const std::vector<std::size_t> all(readings);
  return {name, channel, f < 0 ? "sign" : "scale", f, [all, f](RecordingSet& set) {
            for (const std::size_t k : all) alter::multiply(set, {k}, f);
          }};
}

std::vector<Planted> planted() {
  constexpr std::size_t w = wheel_velocity, v = motor_voltage, i = motor_current;
  return {times("rpm", "wheel_velocity", {w, w + 1}, rpm),
          times("km_h", "wheel_velocity", {w, w + 1}, 3.6),
          times("revolutions", "wheel_velocity", {w, w + 1}, 0.5 / std::numbers::pi),
          times("wheel_degrees", "wheel_velocity", {w, w + 1}, degrees),
          times("doubled_counts", "wheel_velocity", {w, w + 1}, 2),
          times("halved_counts", "wheel_velocity", {w, w + 1}, 0.5),
          times("left_reversed", "wheel_velocity.left", {w + 1}, -1),
          times("right_reversed", "wheel_velocity.right", {w}, -1),
          times("wheels_reversed", "wheel_velocity", {w, w + 1}, -1),
          times("motor_mA", "motor_current", {i, i + 1}, 1000),
          times("motor_mV", "motor_voltage", {v, v + 1}, 1000),
          times("currents_reversed", "motor_current", {i, i + 1}, -1),
          times("left_current_reversed", "motor_current.left", {i + 1}, -1),
          times("voltages_reversed", "motor_voltage", {v, v + 1}, -1),
          times("battery_mA", "battery_current", {battery_current}, 1000),
          times("battery_tenths_A", "battery_current", {battery_current}, 10),
          times("battery_reversed", "battery_current", {battery_current}, -1),
          times("battery_mV", "battery_voltage", {battery_voltage}, 1000),
          times("battery_tenths_V", "battery_voltage", {battery_voltage}, 0.1),
          times("gyro_reversed", "yaw_rate", {yaw_rate}, -1),
          times("gyro_degrees", "yaw_rate", {yaw_rate}, degrees),
          times("position_mm", "pose.position", {x, y}, 1000),
          {"motor_currents_unsigned", "motor_current", "rectified", 1,
           [](RecordingSet& set) {
             alter::each_sample(set, [](signals::Sample& s) {
               for (double& a : s.motor_current_a) a = std::fabs(a);
             });
           }},
          {"supply_voltage", "motor_voltage", "supply", 1, [](RecordingSet& set) {
             alter::each_sample(set, [](signals::Sample& s) {
               s.motor_voltage_v = {s.battery_voltage_v, s.battery_voltage_v};
             });
           }}};
}

const made::Robot& carrier() {
  static const made::Robot robot = made::virtual_robot("amr", 21);
  return robot;
}

robot::RobotModel wrong(robot::RobotModel file) {
  file.idle_power_w *= 3;
  file.mass.chassis_kg *= 1.5;
  return file;
}

class PlantedError : public ::testing::TestWithParam<Planted> {};
class PlantedErrorOfWrongFile : public PlantedError {};

void expect_named(const CorrectedReadings& answer, const Planted& planted) {
  ASSERT_EQ(answer.found.size(), 1u);
  const ReadingCorrection& c = answer.found.front();
  EXPECT_EQ(c.channel, planted.channel) << c.says;
  EXPECT_EQ(c.kind, planted.kind) << c.says;
  EXPECT_NEAR(c.factor / planted.factor, 1, 0.2) << c.says;
  EXPECT_GE(c.probability, 0.5);
  EXPECT_NE(c.says.find("probability"), std::string::npos);
}

TEST_P(PlantedError, IsNamedAlone) {
  RecordingSet set = carrier().recordings;
  GetParam().plant(set);
  expect_named(correct_readings(set, carrier().model), GetParam());
}

TEST_P(PlantedErrorOfWrongFile, IsNamedAlone) {
  RecordingSet set = carrier().recordings;
  GetParam().plant(set);
  expect_named(correct_readings(set, wrong(carrier().model)), GetParam());
}

const auto name = [](const auto& instance) { return std::string(instance.param.name); };
INSTANTIATE_TEST_SUITE_P(Amr, PlantedError, ::testing::ValuesIn(planted()), name);
INSTANTIATE_TEST_SUITE_P(Amr, PlantedErrorOfWrongFile,
                         ::testing::Values(planted()[0], planted()[6], planted()[18], planted()[22]), name);
INSTANTIATE_TEST_SUITE_P(LongAmr, PlantedErrorOfWrongFile, ::testing::ValuesIn(planted()), name);

TEST(Corrections, RestoreReadingsAsSent) {
  RecordingSet set = carrier().recordings;
  alter::multiply(set, {wheel_velocity, wheel_velocity + 1}, 3.6);
  const CorrectedReadings answer = correct_readings(set, carrier().model);
  ASSERT_TRUE(answer.recordings);
  for (std::size_t m = 0; m < set.missions.size(); ++m) {
    const auto& sent = carrier().recordings.missions[m].samples;
    const auto& restored = answer.recordings->missions[m].samples;
    ASSERT_EQ(sent.size(), restored.size());
    for (std::size_t k = 0; k < sent.size(); ++k)
      EXPECT_NEAR(restored[k].wheel_velocity_rad_s[0], sent[k].wheel_velocity_rad_s[0], 1e-9);
  }
  EXPECT_NE(answer.found.front().says.find("The wheel speeds are recorded in km/h"), std::string::npos)
      << answer.found.front().says;
}

TEST(Corrections, LeaveSoundRobotsAlone) {
  for (const char* kind : {"amr", "nomad", "tug"}) {
    for (const bool motors : {true, false}) {
      const made::Robot robot = made::virtual_robot(
          kind, 33, [&](made::vr::SimulationSpec& spec) { spec.sensors.motor_channels = motors; });
      for (const auto& file : {robot.model, wrong(robot.model)}) {
        const CorrectedReadings answer = correct_readings(robot.recordings, file);
        EXPECT_TRUE(answer.found.empty()) << kind << motors << answer.found.front().says;
        EXPECT_FALSE(answer.recordings);
      }
    }
  }
}

TEST(Corrections, PruningKeepsTheAnswer) {
  const std::vector<Planted> all = planted();
  for (const std::size_t k : {0u, 6u, 18u, 22u}) {
    RecordingSet set = carrier().recordings;
    all[k].plant(set);
    const CorrectedReadings pruned = correct_readings(set, carrier().model, true);
    const CorrectedReadings full = correct_readings(set, carrier().model, false);
    EXPECT_LT(pruned.fitted, full.fitted) << all[k].name;
    ASSERT_EQ(pruned.found.size(), full.found.size()) << all[k].name;
    for (std::size_t n = 0; n < full.found.size(); ++n) {
      EXPECT_EQ(pruned.found[n].channel, full.found[n].channel) << all[k].name;
      EXPECT_EQ(pruned.found[n].kind, full.found[n].kind) << all[k].name;
      EXPECT_NEAR(pruned.found[n].probability, full.found[n].probability, 0.05) << all[k].name;
    }
  }
}

}  // namespace
}  // namespace joulecast::gap
