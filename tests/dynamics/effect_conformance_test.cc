// Requirements on every effect of the catalogue.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>

#include "dynamics/catalogue.h"
#include "dynamics/drive_model.h"
#include "tests/dynamics/forward/forward.h"
#include "tests/dynamics/random_motion.h"
#include "tests/support/sample_robots.h"

namespace joulecast::dynamics {
namespace {

using testing::random_motion;

robot::RobotModel offset_robot() {
  robot::RobotModel robot = testing::nomad();
  robot.kinematics.com_offset_m = 0.03;
  return robot;
}

// A strength that matters but stays inside the bounds.
ActiveEffect moderate(const Effect& effect) {
  ActiveEffect active = initial(effect);
  const EffectParameter& strength = effect.info().parameters[0];
  active.values[0] = std::min(0.2, 0.5 * strength.maximum);
  return active;
}

class EveryEffect : public ::testing::TestWithParam<const Effect*> {};

TEST_P(EveryEffect, DescribesItselfCompletely) {
  const EffectInfo& info = GetParam()->info();
  EXPECT_FALSE(info.formula.empty());
  EXPECT_FALSE(info.validity.empty());
  EXPECT_FALSE(info.source.empty());
  ASSERT_FALSE(info.parameters.empty());
  ASSERT_LE(info.parameters.size(), max_effect_parameters);
  EXPECT_EQ(info.parameters[0].initial, 0);
  for (const EffectParameter& p : info.parameters) {
    EXPECT_LE(p.minimum, p.initial) << p.name;
    EXPECT_GE(p.maximum, p.initial) << p.name;
    EXPECT_FALSE(p.unit.empty()) << p.name;
    EXPECT_FALSE(p.meaning.empty()) << p.name;
  }
}

TEST_P(EveryEffect, ZeroStrengthEqualsNominalModel) {
  const robot::RobotModel robot = offset_robot();
  const ActiveEffect zero = initial(*GetParam());
  const DriveModel nominal(robot, {}), with(robot, {&zero, 1});
  std::mt19937 random(1);
  for (int k = 0; k < 200; ++k) {
    const Instant at = random_motion(random);
    const auto a = nominal.flow(at), b = with.flow(at);
    EXPECT_EQ(a.battery_power_w, b.battery_power_w);
    EXPECT_EQ(a.current_a, b.current_a);
    EXPECT_EQ(a.voltage_v, b.voltage_v);
    EXPECT_EQ(nominal.metered_battery_power(30, 24), with.metered_battery_power(30, 24));
  }
}

TEST_P(EveryEffect, KeepsTheLedgerClosed) {
  const ActiveEffect active = moderate(*GetParam());
  const DriveModel model(offset_robot(), {&active, 1});
  std::mt19937 random(2);
  for (int k = 0; k < 500; ++k) {
    const auto flow = model.flow(random_motion(random));
    const double scale = std::fabs(flow.ledger[signals::Term::copper]) +
                         std::fabs(flow.ledger[signals::Term::kinetic]) +
                         std::fabs(flow.ledger[signals::Term::braking]) + std::fabs(flow.battery_power_w);
    EXPECT_NEAR(flow.ledger.total(), flow.battery_power_w, 1e-12 * scale);
  }
}

TEST_P(EveryEffect, DerivativesAgreeWithFiniteDifferences) {
  const robot::RobotModel robot = offset_robot();
  const EffectInfo& info = GetParam()->info();
  ActiveEffect active = moderate(*GetParam());
  // Switches, regions and time constants are searched, not differentiated.
  const std::set<std::string_view> searched = {"side", "x_m", "y_m", "radius_m", "time_constant_s"};
  std::mt19937 random(3);
  for (std::size_t p = 0; p < info.parameters.size(); ++p) {
    if (searched.contains(info.parameters[p].name)) continue;
    const BasicDriveModel<Dual> exact(robot, {&active, 1}, 0, p);
    // A step of the cube root of the rounding error keeps truncation and rounding of the central difference
    // equal.
    const double step = 6e-6 * std::max(1.0, std::fabs(active.values[p]));
    ActiveEffect up = active, down = active;
    up.values[p] += step;
    down.values[p] -= step;
    const DriveModel above(robot, {&up, 1}), below(robot, {&down, 1});
    for (int k = 0; k < 100; ++k) {
      const Instant at = random_motion(random);
      const auto f = exact.flow(at);
      const auto a = above.flow(at), b = below.flow(at);
      if (a.motor_power_w[0] * b.motor_power_w[0] < 0 || a.motor_power_w[1] * b.motor_power_w[1] < 0)
        continue;  // at a kink
      const auto check = [&](Dual value, double hi, double lo, const char* what) {
        const double difference = (hi - lo) / (2 * step);
        EXPECT_NEAR(value.slope, difference, 1e-6 * (std::fabs(difference) + std::fabs(value.value)) + 1e-9)
            << what << " by " << info.parameters[p].name;
      };
      check(f.battery_power_w, a.battery_power_w, b.battery_power_w, "battery power");
      check(f.torque_nm[0], a.torque_nm[0], b.torque_nm[0], "torque");
      check(f.voltage_v[1], a.voltage_v[1], b.voltage_v[1], "voltage");
      check(exact.metered_battery_power(f.battery_power_w, 24),
            above.metered_battery_power(a.battery_power_w, 24),
            below.metered_battery_power(b.battery_power_w, 24), "metered power");
    }
  }
}

TEST_P(EveryEffect, ForwardMotionInvertsTheBalance) {
  const ActiveEffect active = moderate(*GetParam());
  const DriveModel model(offset_robot(), {&active, 1});
  std::mt19937 random(4);
  for (int k = 0; k < 100; ++k) {
    const Instant at = random_motion(random);
    DriveState state;
    state.x_m = at.x_m;
    state.y_m = at.y_m;
    state.heading_rad = at.heading_rad;
    state.climb_rad = at.climb_rad;
    state.wheel_speed_rad_s = at.wheel_speed_rad_s;
    state.copper_heat_w = at.copper_heat_w;
    const auto torque = model.balance(at).total_nm;
    const auto acceleration = wheel_accelerations(model, state, at.payload_kg, torque);
    for (std::size_t s : {0u, 1u}) EXPECT_NEAR(acceleration[s], at.wheel_acceleration_rad_s2[s], 1e-9);
  }
}

TEST_P(EveryEffect, SurvivesTheRobotFile) {
  const ActiveEffect active = moderate(*GetParam());
  const Result<ActiveEffect> back = activate(adopt(active));
  ASSERT_TRUE(back) << describe(back.error());
  EXPECT_EQ(back->effect, active.effect);
  EXPECT_EQ(back->values, active.values);
}

TEST_P(EveryEffect, RejectsValuesBeyondBounds) {
  const EffectInfo& info = GetParam()->info();
  for (const EffectParameter& p : info.parameters) {
    robot::AdoptedEffect adopted = adopt(moderate(*GetParam()));
    for (auto& [name, value] : adopted.parameters) {
      if (name == p.name) value = p.maximum + 1;
    }
    const Result<ActiveEffect> refused = activate(adopted);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().field, "/effects/" + std::string(info.id) + "/" + std::string(p.name));
    EXPECT_EQ(refused.error().message.find(" 1,"), std::string::npos) << refused.error().message;
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryEffect, ::testing::ValuesIn(catalogue().begin(), catalogue().end()),
                         [](const auto& instance) { return std::string(instance.param->info().id); });

// Those that dissipate cost power wherever the robot speeds up.
TEST(Dissipation, CostsPowerInDriving) {
  const robot::RobotModel robot = testing::nomad();
  Instant at;
  at.wheel_speed_rad_s = {6, 4};
  at.wheel_acceleration_rad_s2 = {0.5, 0.4};
  at.payload_kg = 8;
  at.x_m = at.y_m = 0;
  at.heading_rad = 0;
  at.climb_rad = 0.05;
  at.copper_heat_w = {10, 10};
  const double nominal = DriveModel(robot, {}).flow(at).battery_power_w;
  for (const char* id : {"coulomb_friction", "viscous_friction", "stribeck_friction", "friction_asymmetry",
                         "load_rolling_resistance", "floor_resistance_zone", "slope", "grade",
                         "aerodynamic_drag", "turning_scrub", "gear_efficiency", "resistance_error",
                         "winding_temperature", "brush_drop", "accessory_load", "driver_loss"}) {
    ActiveEffect active = moderate(*find_effect(id));
    EXPECT_GT(DriveModel(robot, {&active, 1}).flow(at).battery_power_w, nominal) << id;
  }
}

// What two effects do together does not depend on which is named first.
TEST(TwoEffects, AreIndependentOfOrder) {
  const robot::RobotModel robot = offset_robot();
  for (const Effect* one : catalogue()) {
    for (const Effect* other : catalogue()) {
      if (one == other) break;
      const ActiveEffect forth[] = {moderate(*one), moderate(*other)}, back[] = {forth[1], forth[0]};
      const DriveModel a(robot, forth), b(robot, back);
      std::mt19937 random(5);
      for (int k = 0; k < 20; ++k) {
        const Instant at = random_motion(random);
        const double power_w = a.flow(at).battery_power_w;
        EXPECT_NEAR(power_w, b.flow(at).battery_power_w, 1e-9 * (1 + std::fabs(power_w)))
            << one->info().id << " and " << other->info().id;
      }
    }
  }
}

TEST(TwoEffects, LossesOfGearsAdd) {
  const robot::RobotModel robot = testing::nomad();
  const auto loss_nm = [&](std::vector<std::array<double, 2>> losses) {
    std::vector<ActiveEffect> gears;
    for (const auto& [loss, of_friction] : losses) {
      gears.push_back(initial(*find_effect("gear_efficiency")));
      gears.back().values[0] = loss;
      gears.back().values[1] = of_friction;
    }
    Instant at;
    at.wheel_speed_rad_s = {6, 4};
    at.wheel_acceleration_rad_s2 = {0.5, 0.4};
    return DriveModel(robot, gears).balance(at).gear_nm[0];
  };
  EXPECT_NEAR(loss_nm({{0.04, 0}, {0.01, 1}}), loss_nm({{0.04, 0}}) + loss_nm({{0.01, 1}}), 1e-12);
  EXPECT_NEAR(loss_nm({{0.04, 1}, {0, 0}}), loss_nm({{0.04, 1}}), 1e-12);
}

// Effects that share T_m, as described by their parameters' meanings: each scales the contributions of those
// named in its meaning.
TEST(TwoEffects, DryFrictionScalesNamedTerms) {
  const robot::RobotModel robot = testing::nomad();
  const auto with = [](const char* id, double strength) {
    ActiveEffect active = initial(*find_effect(id));
    active.values[0] = strength;
    return active;
  };
  const ActiveEffect both[] = {with("coulomb_friction", 1), with("friction_asymmetry", 1.5)};
  const DriveModel nominal(robot, {}), worn(robot, both);
  const auto dry = nominal.parameters().friction_torque_nm, of_worn = worn.parameters().friction_torque_nm;
  EXPECT_NEAR(of_worn[0], 2 * 2.5 * dry[0], 1e-12);
  EXPECT_NEAR(of_worn[1], 2 * dry[1], 1e-12);
  Instant at;
  at.wheel_speed_rad_s = {1, 1};
  const ActiveEffect three[] = {both[0], both[1], with("stribeck_friction", 0.5)}, alone[] = {three[2]};
  const DriveModel sticking(robot, three), sticking_alone(robot, alone);
  for (const std::size_t s : {0u, 1u}) {
    const double extra = sticking.balance(at).total_nm[s] - worn.balance(at).total_nm[s];
    const double extra_alone = sticking_alone.balance(at).total_nm[s] - nominal.balance(at).total_nm[s];
    EXPECT_GT(extra_alone, 0);
    EXPECT_NEAR(extra / extra_alone, of_worn[s] / dry[s], 1e-9);
  }
}

TEST(YawInertiaError, KeepsThePayloadsYawInertia) {
  const robot::RobotModel robot = testing::nomad();
  ActiveEffect error = initial(*find_effect("yaw_inertia_error"));
  error.values[0] = 0.5;
  const DriveModel nominal(robot, {}), with(robot, {&error, 1});
  Instant at;
  at.wheel_speed_rad_s = {1, -1};
  at.wheel_acceleration_rad_s2 = {1, -1};
  const auto extra = [&](double payload_kg) {
    at.payload_kg = payload_kg;
    return with.balance(at).total_nm[0] - nominal.balance(at).total_nm[0];
  };
  EXPECT_GT(extra(0), 0);
  EXPECT_NEAR(extra(10), extra(0), 1e-9 * extra(0));
}

TEST(Catalogue, HasUniqueIds) {
  std::set<std::string_view> ids;
  for (const Effect* effect : catalogue()) ids.insert(effect->info().id);
  EXPECT_EQ(ids.size(), catalogue().size());
  EXPECT_EQ(ids.size(), 33u);
  const auto unknown = activate({"warp_drive", {}});
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().field, "/effects/warp_drive");
  EXPECT_EQ(activate({"coulomb_fricton", {}}).error().message,
            "is not an effect of the catalogue; did you mean coulomb_friction?");
  const auto unnamed = activate({"slope", {{"steepness", 1}}});
  ASSERT_FALSE(unnamed);
  EXPECT_EQ(unnamed.error().field, "/effects/slope/steepness");
  EXPECT_FALSE(activate({"slope", {{"uphill_rad", 1}}}));  // no strength
}

}  // namespace
}  // namespace joulecast::dynamics
