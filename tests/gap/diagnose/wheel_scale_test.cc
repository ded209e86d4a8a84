#include "gap/diagnose/wheel_scale.h"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/gap/diagnose/made_drives.h"

namespace joulecast::gap {
namespace {

constexpr double rpm = 60 / (2 * std::numbers::pi);

// Checks drives with wheel speeds recorded in another unit.
std::optional<Check> judge(const std::vector<Cause>& causes, double unit) {
  const made::Drives drives(causes);
  std::vector<Window> recorded = drives.windows();
  for (Window& w : recorded) {
    for (const std::size_t s : {0u, 1u}) {
      w.speed_rad_s[s] *= unit;
      w.acceleration_rad_s2[s] *= unit;
      for (auto& part : w.part_speed_rad_s) part[s] *= unit;
      for (auto& part : w.part_acceleration_rad_s2) part[s] *= unit;
    }
  }
  const std::vector<double> modelled = modelled_power(drives.robot(), {}, {}, recorded);
  return wheel_scale_by_power(drives.robot(), {}, recorded, drives.power_w,
                              gap_size(drives.power_w, modelled).absolute_relative);
}

TEST(WheelScale, NamesUnitMatchingPower) {
  const auto check = judge({made::cause("coulomb_friction", 0.2)}, rpm);
  ASSERT_TRUE(check);
  EXPECT_NE(check->says.find("wheel_velocity looks given in rpm"), std::string::npos) << check->says;
  EXPECT_NEAR(check->value, rpm, 1e-3);
  EXPECT_TRUE(check->contradicted);
}

TEST(WheelScale, RejectsModelErrorAsUnit) {
  EXPECT_FALSE(judge({}, 1));
  EXPECT_FALSE(judge({made::cause("coulomb_friction", 6)}, 1));
  EXPECT_FALSE(judge({made::cause("accessory_load", 300)}, 1));
}

}  // namespace
}  // namespace joulecast::gap
