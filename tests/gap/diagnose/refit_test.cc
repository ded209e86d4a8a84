#include "gap/diagnose/refit.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include "gap/diagnose/held_out.h"
#include "gap/diagnose/power_fit.h"
#include "made_drives.h"

namespace joulecast::gap {
namespace {

using made::cause;
using made::Drives;

double strength_of(const std::vector<Cause>& causes, std::string_view id) {
  for (const Cause& c : causes) {
    if (c.effect.effect->info().id == id) return c.effect.values[0];
  }
  return std::nan("");
}

TEST(Refit, LeavesNothingOfAPowerThatItsCausesMake) {
  const Drives drives({cause("coulomb_friction", 0.6), cause("accessory_load", 6)});
  const std::vector<Cause> found =
      refit(drives.material(), {cause("coulomb_friction", 0.1), cause("accessory_load", 1)});
  EXPECT_NEAR(strength_of(found, "coulomb_friction"), 0.6, 0.01);
  EXPECT_NEAR(strength_of(found, "accessory_load"), 6, 0.1);
  EXPECT_LT(drives.gap(found), 0.002);
}

TEST(Refit, ReadingsThatAreThrownHardlyMoveIt) {
  Drives drives({cause("coulomb_friction", 0.6), cause("accessory_load", 6)});
  drives.throw_readings();
  const std::vector<Cause> found =
      refit(drives.material(), {cause("coulomb_friction", 0.1), cause("accessory_load", 1)});
  EXPECT_NEAR(strength_of(found, "coulomb_friction"), 0.6, 0.06);
  EXPECT_NEAR(strength_of(found, "accessory_load"), 6, 0.6);
}

TEST(FittedToPower, LeavesLeastWhereEverythingIsLinear) {
  const Drives drives({cause("accessory_load", 6)});
  const Linear linear = linearise(drives.material(), {}, std::array{1.0}, {});
  const auto at = linear.columns->coordinates_of(cause("accessory_load", 6));
  ASSERT_TRUE(at);
  const Equations equations{*linear.columns, linear.rows, linear.noise};
  ASSERT_TRUE(power_speaks_alone(equations));
  const Eigen::VectorXd fitted =
      fitted_to_power(equations, {at->hypothesis}, Eigen::VectorXd::Constant(1, 2.0));
  EXPECT_NEAR(fitted[0], 6, 0.05);
  EXPECT_NEAR(moved_power(equations, {at->hypothesis}, fitted).mean(), 6, 0.5);
}

TEST(BaseFit, FindsARobotThatIsFarFromItsFile) {
  const Drives drives(
      {cause("coulomb_friction", 1.5), cause("turning_scrub", 0.5), cause("accessory_load", 12)});
  ASSERT_GT(drives.gap({}), 0.3);
  for (const Starts starts : {Starts::regression, Starts::both}) {
    const std::vector<Cause> base = base_fit(drives.material(), drives.power_w, starts);
    EXPECT_LT(drives.gap(base), 0.1 * drives.gap({}));
    EXPECT_NEAR(strength_of(base, "accessory_load"), 12, 3);
  }
}

TEST(BaseNeeded, IsSureOfWhatPartsLeftOutMissAndNotOfTheRest) {
  const Drives drives({cause("coulomb_friction", 1.5), cause("accessory_load", 12)});
  FitResult fit;
  fit.base = {cause("coulomb_friction", 1.5), cause("accessory_load", 12), cause("aerodynamic_drag", 0.01)};
  fit.alone = true;
  for (const Cause& c : fit.base) fit.in_force.push_back(c.effect);
  const auto held = hold_out(drives.material(), fit, drives.power_w, {}, [](double) { return true; });
  ASSERT_TRUE(held);
  EXPECT_LT(held->explained(), 0.01);
  const std::vector<Need> needs = base_needed(drives.material(), fit, *held, drives.power_w);
  ASSERT_EQ(needs.size(), 3u);
  for (const std::size_t k : {0u, 1u}) {
    EXPECT_GT(needs[k].probability, 0.95);
    EXPECT_GT(needs[k].share, 0.02);
  }
  EXPECT_LT(needs[2].share, 0.002);
}

}  // namespace
}  // namespace joulecast::gap
