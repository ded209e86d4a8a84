#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>

#include "gap/equations/columns.h"
#include "tests/gap/diagnose/made_drives.h"

namespace joulecast::gap {
namespace {

// Names of causes, and channels of functions outside the catalogue.
std::set<std::string> names_with(bool kinematics) {
  const made::Drives drives({});
  Material material = drives.material();
  material.from_motion.kinematics = kinematics;
  const ColumnSet columns(material, {}, std::array{0.07});
  std::set<std::string> names;
  for (const Hypothesis& h : columns.hypotheses()) names.insert(h.outside() ? h.channel : h.id());
  return names;
}

TEST(PowerAlone, LeavesKinematicsToTheChecks) {
  const std::set<std::string> with = names_with(true), without = names_with(false);
  for (const char* name : {"wheel_radius_error", "wheel_radius_asymmetry", "track_error", "wheel_slip",
                           "com_offset", "yaw_rate", "map_travel"}) {
    EXPECT_TRUE(with.contains(name)) << name;
    EXPECT_FALSE(without.contains(name)) << name;
  }
  EXPECT_EQ(without.size() + 7, with.size());
}

TEST(PowerAlone, IsWithoutMotorVoltagesAndCurrents) {
  windows::Readings read;
  EXPECT_TRUE(from_motion_of(read).kinematics);  // nothing else was read
  read.battery_power = true;
  EXPECT_FALSE(from_motion_of(read).kinematics);
  read.motor_voltages = true;
  EXPECT_TRUE(from_motion_of(read).kinematics && from_motion_of(read).voltage);
  read.motor_currents = true;
  EXPECT_TRUE(from_motion_of(read).kinematics);
  EXPECT_FALSE(from_motion_of(read).power || from_motion_of(read).voltage);
}

TEST(PowerAlone, ComparesStartsAndStops) {
  const made::Drives drives({});
  const dynamics::DriveModel model(drives.material().robot, {});
  std::size_t between = 0;
  for (const Window& w : drives.material().windows) {
    const auto r = residuals(model, w, drives.material().from_motion);
    // The drives' power is the model's.
    EXPECT_NEAR(r[index_of(Channel::power)], 0, 1e-9);
    between += w.moving[0] || w.resting[0] ? 0 : 1;
  }
  EXPECT_GT(between, 10u);
}

// 1 A of bias is as much power as the mission's mean voltage, whatever a reading's own noise.
TEST(PowerAlone, BiasActsAtTheMissionsVoltage) {
  const made::Drives drives({});
  const std::array effects{made::cause("current_sensor_bias", 0).effect};
  const dynamics::BasicDriveModel<dynamics::Dual> model(drives.material().robot, effects, 0, 0);
  Window w = drives.material().windows.front();
  w.mission_voltage_v = 24;
  for (const double own_v : {20.0, 28.0}) {
    w.battery_voltage_v = own_v;
    EXPECT_NEAR(metered_power(model, w).slope, 24, 1e-9);
  }
}

}  // namespace
}  // namespace joulecast::gap
