#include <gtest/gtest.h>

#include <array>

#include "tests/gap/diagnose/made_drives.h"

namespace joulecast::gap {
namespace {

// A bias of 1 A acts at the mission's mean voltage, independent of the noise of single readings.
TEST(PowerAlone, AppliesBiasAtMissionVoltage) {
  const made::Drives drives;
  const std::array effects{made::cause("current_sensor_bias", 0).effect};
  const dynamics::BasicDriveModel<dynamics::Dual> model(drives.robot(), effects, 0, 0);
  Window w = drives.windows().front();
  w.mission_voltage_v = 24;
  for (const double own_v : {20.0, 28.0}) {
    w.battery_voltage_v = own_v;
    EXPECT_NEAR(metered_powers(model, w).battery_w.slope, 24, 1e-9);
  }
}

}  // namespace
}  // namespace joulecast::gap
