// Two effects adopted together: what each changes is over the robot file's values, and adds.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <random>

#include "dynamics/catalogue.h"
#include "dynamics/drive_model.h"
#include "tests/dynamics/random_motion.h"
#include "tests/support/sample_robots.h"

namespace joulecast::dynamics {
namespace {

robot::RobotModel a_robot() {
  robot::RobotModel robot = testing::nomad();
  robot.kinematics.com_offset_m = 0.03;
  return robot;
}

ActiveEffect moderate(const Effect& effect) {
  ActiveEffect active = initial(effect);
  active.values[0] = std::min(0.2, 0.5 * effect.info().parameters[0].maximum);
  return active;
}

// Every number of the parameters, those of fields to come too.
using Numbers = std::array<double, sizeof(Parameters<double>) / sizeof(double)>;
Numbers numbers_of(const DriveModel& model) {
  return std::bit_cast<Numbers>(model.parameters());
}

TEST(EffectPairs, ChangesOfEveryPairAddAndKnowNoOrder) {
  const robot::RobotModel robot = a_robot();
  const Numbers nominal = numbers_of(DriveModel(robot, {}));
  std::mt19937 random(5);
  std::size_t pairs = 0;
  for (const Effect* first : catalogue()) {
    for (const Effect* second : catalogue()) {
      if (first == second) continue;
      ++pairs;
      SCOPED_TRACE(std::string(first->info().id) + " and " + std::string(second->info().id));
      const std::array both{moderate(*first), moderate(*second)}, turned{both[1], both[0]};
      const DriveModel together(robot, both), other_way(robot, turned);
      const Numbers a = numbers_of(DriveModel(robot, {&both[0], 1})),
                    b = numbers_of(DriveModel(robot, {&both[1], 1})), ab = numbers_of(together);
      for (std::size_t k = 0; k < ab.size(); ++k) {
        const double changes = (a[k] - nominal[k]) + (b[k] - nominal[k]);
        EXPECT_NEAR(ab[k] - nominal[k], changes, 1e-12 * (1 + std::fabs(ab[k]))) << "parameter " << k;
      }
      for (int k = 0; k < 10; ++k) {
        const Instant at = testing::random_motion(random);
        const auto p = together.flow(at), q = other_way.flow(at);
        const double scale = 1 + std::fabs(p.battery_power_w);
        EXPECT_NEAR(p.battery_power_w, q.battery_power_w, 1e-10 * scale);
        EXPECT_NEAR(p.torque_nm[0], q.torque_nm[0], 1e-10 * (1 + std::fabs(p.torque_nm[0])));
      }
    }
  }
  EXPECT_EQ(pairs, catalogue().size() * (catalogue().size() - 1));
}

// The text of effects.md in numbers: T = T_m (1 + coulomb + that side's asymmetry + stribeck exp(-(w/w_s)^d))
// + extra.
TEST(EffectPairs, DryFrictionIsAsTheDocumentSays) {
  const robot::RobotModel robot = a_robot();
  constexpr double coulomb = 0.4, extra_nm = 0.07, asymmetry = 0.5, stribeck = 0.8, speed = 1.5,
                   exponent = 1.4;
  for (const unsigned set : {1u, 2u, 3u, 4u, 5u, 6u, 7u}) {
    robot::RobotModel with = robot;
    if (set & 1u) with.effects.push_back({"coulomb_friction", {{"ratio", coulomb}, {"extra_nm", extra_nm}}});
    if (set & 2u) with.effects.push_back({"friction_asymmetry", {{"ratio", asymmetry}, {"side", 1}}});
    if (set & 4u)
      with.effects.push_back(
          {"stribeck_friction", {{"ratio", stribeck}, {"speed_rad_s", speed}, {"exponent", exponent}}});
    const auto model = drive_model(with);
    ASSERT_TRUE(model) << describe(model.error());
    for (const double w : {0.8, 2.0, 6.0}) {
      Instant at;
      at.wheel_speed_rad_s = {w, w};
      const auto balance = model->balance(at);
      for (const std::size_t s : {0u, 1u}) {
        const double file_nm = robot.motor.friction_torque_nm[s];
        double ratio = 1, extra = 0;
        if (set & 1u) ratio += coulomb, extra = extra_nm;
        if ((set & 2u) && s == 1) ratio += asymmetry;
        if (set & 4u) ratio += stribeck * std::exp(-std::pow(w / speed, exponent));
        EXPECT_NEAR(balance.total_nm[s], file_nm * ratio + extra + robot.motor.viscous_friction_nm_s_rad * w,
                    1e-4)
            << set << " at " << w;
      }
    }
  }
}

}  // namespace
}  // namespace joulecast::dynamics
