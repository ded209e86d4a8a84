#include "gap/next_drive.h"

#include <gtest/gtest.h>

#include "gap/outside.h"

namespace joulecast::gap {
namespace {

TEST(NextDrive, HasADriveForWhateverSomethingUnknownMayFollow) {
  Ranges everything;
  everything.position = everything.heading = everything.payload_varies = true;
  for (const bool power : {false, true}) {
    for (const OutsideFamily& family : outside_families(everything, power)) {
      const auto drives =
          drives_for({.probability = 1, .channel = "", .follows = std::string(family.variable)});
      EXPECT_EQ(drives.size(), 1u) << family.variable;
    }
  }
  EXPECT_EQ(drives_for({.probability = 1, .channel = "", .follows = "wheel_angle"}).size(), 1u);
  EXPECT_TRUE(drives_for({}).empty());
}

}  // namespace
}  // namespace joulecast::gap
