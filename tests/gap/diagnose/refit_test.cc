#include "gap/diagnose/refit.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include "gap/diagnose/fit.h"
#include "gap/diagnose/held_out.h"
#include "gap/diagnose/power_fit.h"
#include "gap/equations/power.h"
#include "tests/gap/checks/made_recordings.h"

namespace joulecast::gap {
namespace {

// A robot's drives whose battery power is what the model with known causes gives for them, and nothing else
// is measured: what a fit has to find is known to the last digit.
class Drives {
 public:
  explicit Drives(std::vector<Cause> causes) : truth(std::move(causes)) {
    const auto readings = windows::find_readings(robot_.recordings.missions, robot_.model);
    windows_ = windows::make_windows(robot_.recordings.missions, robot_.model, readings);
    std::vector<double> lengths_s;
    for (const telemetry::Recording& m : robot_.recordings.missions)
      lengths_s.push_back(1e-6 * static_cast<double>(m.samples.back().utime_us - m.samples.front().utime_us));
    blocks_ = windows::assign_blocks(windows_, lengths_s);
    power_w = modelled_power(robot_.model, {}, truth, windows_);
    set_power();
  }

  // Every twelfth reading is far off.
  void throw_readings() {
    for (std::size_t k = 0; k < power_w.size(); k += 12) power_w[k] += 300;
    set_power();
  }

  Material material() const {
    return {robot_.model, {}, windows_, blocks_, {.power = true, .voltage = false}, 0.04};
  }
  double gap(const std::vector<Cause>& causes) const {
    return gap_size(power_w, modelled_power(robot_.model, {}, causes, windows_)).absolute_relative;
  }

  std::vector<Cause> truth;
  std::vector<double> power_w;

 private:
  void set_power() {
    for (std::size_t k = 0; k < windows_.size(); ++k) windows_[k].battery_power_w = power_w[k];
  }

  made::Robot robot_ = made::virtual_robot(
      "nomad", 41, [](made::vr::SimulationSpec& spec) { spec.sensors.motor_channels = false; });
  std::vector<Window> windows_;
  std::size_t blocks_ = 0;
};

Cause cause(std::string_view id, double strength) {
  Cause c;
  c.effect.effect = dynamics::find_effect(id);
  for (std::size_t k = 0; k < c.effect.effect->info().parameters.size(); ++k)
    c.effect.values[k] = c.effect.effect->info().parameters[k].initial;
  c.effect.values[0] = strength;
  return c;
}

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
