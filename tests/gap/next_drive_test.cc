#include "gap/verdict/next_drive.h"

#include <gtest/gtest.h>

#include <string_view>

#include "gap/equations/families.h"

namespace joulecast::gap {
namespace {

Outside following(std::string_view variable) {
  Outside outside;
  outside.probability = 1;
  outside.follows = variable;
  return outside;
}

TEST(NextDrive, HasADriveForWhateverSomethingUnknownMayFollow) {
  Ranges everything;
  everything.position = everything.heading = everything.climb = everything.payload_varies = true;
  for (const bool power : {false, true}) {
    for (const OutsideFamily& family : outside_families(everything, FromMotion{power, false})) {
      const auto drives = drives_for(following(family.variable));
      EXPECT_EQ(drives.size(), 1u) << family.variable;
    }
  }
  EXPECT_EQ(drives_for(following("wheel_angle")).size(), 1u);
  EXPECT_TRUE(drives_for({}).empty());
}

}  // namespace
}  // namespace joulecast::gap
