#include <gtest/gtest.h>

#include <array>

#include "tests/gap/diagnose/made_drives.h"

namespace joulecast::gap {
namespace {

TEST(PowerAlone, ComparesStartsAndStops) {
  const made::Drives drives;
  const dynamics::DriveModel model(drives.robot(), {});
  std::size_t between = 0;
  for (const Window& w : drives.windows()) {
    const auto r = residuals(model, w, FromMotion{.power = true, .voltage = false});
    // The drives have the model's power.
    EXPECT_NEAR(r[index_of(Channel::power)], 0, 1e-9);
    between += w.moving[0] || w.resting[0] ? 0 : 1;
  }
  EXPECT_GT(between, 10u);
}

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
