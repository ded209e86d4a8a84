// Every effect of the catalogue in every library that uses it: forward motion, meter and planner give the
// power of the inverse model, and the energy appears in the effect's own terms of the ledger.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <string_view>
#include <vector>

#include "dynamics/catalogue.h"
#include "energy/meter.h"
#include "energy/rates.h"
#include "planning/load.h"
#include "tests/dynamics/forward/forward.h"
#include "tests/dynamics/random_motion.h"
#include "tests/support/sample_robots.h"

namespace joulecast {
namespace {

using dynamics::ActiveEffect;
using dynamics::DriveModel;
using dynamics::Effect;
using dynamics::Instant;
using signals::Term;

robot::RobotModel robot_with(const Effect* effect) {
  robot::RobotModel robot = testing::nomad();
  robot.kinematics.com_offset_m = 0.03;
  if (effect != nullptr) {
    ActiveEffect active = dynamics::initial(*effect);
    active.values[0] = std::min(0.15, 0.5 * effect->info().parameters[0].maximum);
    robot.effects = {dynamics::adopt(active)};
  }
  return robot;
}

DriveModel model_with(const Effect* effect) {
  return *dynamics::drive_model(robot_with(effect));
}

class EffectEverywhere : public ::testing::TestWithParam<const Effect*> {
 protected:
  std::string_view id() const { return GetParam()->info().id; }
};
INSTANTIATE_TEST_SUITE_P(Catalogue, EffectEverywhere,
                         ::testing::ValuesIn(dynamics::catalogue().begin(), dynamics::catalogue().end()),
                         [](const auto& instance) { return std::string(instance.param->info().id); });

// Responses of the ledger's terms to a positive strength at the same motion. The electrical terms that follow
// from the torque (copper and regeneration) count as an effect's own only where they are listed.
enum class Answer {
  loses,     // nowhere less, somewhere more: dissipation
  returns,   // nowhere more, somewhere less: a smaller credit
  exchanges  // both signs: stored energy, or a reading
};
using Answers = std::vector<std::pair<Term, Answer>>;

const std::map<std::string_view, Answers>& answers() {
  static const std::map<std::string_view, Answers> table{
      {"coulomb_friction", {{Term::friction_internal, Answer::loses}}},
      {"viscous_friction", {{Term::friction_internal, Answer::loses}}},
      {"stribeck_friction", {{Term::friction_internal, Answer::loses}}},
      {"friction_asymmetry", {{Term::friction_internal, Answer::loses}}},
      {"load_rolling_resistance", {{Term::friction_rolling, Answer::loses}}},
      {"floor_resistance_zone", {{Term::friction_zone, Answer::loses}}},
      {"slope", {{Term::potential, Answer::exchanges}}},
      {"grade", {{Term::potential, Answer::exchanges}}},
      {"aerodynamic_drag", {{Term::drag, Answer::loses}}},
      {"turning_scrub", {{Term::friction_scrub, Answer::loses}}},
      {"gear_efficiency", {{Term::friction_internal, Answer::loses}}},
      {"chassis_mass_error", {{Term::kinetic, Answer::exchanges}}},
      {"payload_mass_error", {{Term::kinetic, Answer::exchanges}}},
      {"yaw_inertia_error", {{Term::kinetic, Answer::exchanges}}},
      {"linear_inertia_error", {{Term::kinetic, Answer::exchanges}}},
      {"com_offset", {}},  // its force and its moment on the body cancel in power
      {"resistance_error", {{Term::copper, Answer::loses}}},
      {"winding_temperature", {{Term::copper, Answer::loses}}},
      {"brush_drop", {{Term::brush, Answer::loses}}},
      {"torque_constant_loss", {{Term::copper, Answer::loses}}},
      {"inductance", {{Term::kinetic, Answer::exchanges}}},
      {"accessory_load", {{Term::accessories, Answer::loses}}},
      {"driver_loss", {{Term::driver, Answer::loses}}},
      {"no_regeneration", {{Term::recovered, Answer::returns}}},
      {"battery_resistance", {}},  // inside the battery; the ledger begins at its terminals
      {"wheel_radius_error", {{Term::kinetic, Answer::exchanges}}},
      {"wheel_radius_asymmetry", {{Term::kinetic, Answer::exchanges}}},
      {"track_error", {{Term::kinetic, Answer::exchanges}}},
      {"wheel_slip", {{Term::friction_slip, Answer::exchanges}, {Term::kinetic, Answer::exchanges}}},
      {"current_sensor_gain", {{Term::sensor, Answer::loses}}},  // of a battery that gives power
      {"current_sensor_bias", {{Term::sensor, Answer::loses}}},
      {"voltage_sensor_gain", {{Term::sensor, Answer::loses}}},
      {"sensor_delay", {}}};  // shifts readings in time only
  return table;
}

energy::Rates rates_of(const DriveModel& model, const Instant& at) {
  energy::Reading reading;
  reading.motion = at;
  std::array<double, 2> copper_w{};
  return energy::rates_at(model, reading, {}, copper_w);
}

TEST_P(EffectEverywhere, ChangesItsLedgerTerms) {
  ASSERT_TRUE(answers().contains(id())) << "answers() has no ledger terms for " << id();
  const Answers& own = answers().at(id());
  const DriveModel nominal = model_with(nullptr), with = model_with(GetParam());
  std::mt19937 random(11);
  std::array<double, signals::term_count> most{}, least{};
  for (int k = 0; k < 400; ++k) {
    const Instant at = testing::random_motion(random);
    const auto a = rates_of(nominal, at), b = rates_of(with, at);
    for (std::size_t t = 0; t < signals::term_count; ++t) {
      const double change = b[energy::account::ledger + t] - a[energy::account::ledger + t];
      most[t] = std::max(most[t], change);
      least[t] = std::min(least[t], change);
    }
  }
  constexpr double rounding_w = 1e-9;
  // Copper losses follow any torque, and regeneration follows both.
  const auto follows = [](Term t) { return t == Term::copper || t == Term::braking || t == Term::recovered; };
  for (std::size_t t = 0; t < signals::term_count; ++t) {
    const auto term = static_cast<Term>(t);
    const auto answer = std::ranges::find(own, term, &std::pair<Term, Answer>::first);
    SCOPED_TRACE(signals::term_names[t]);
    if (answer == own.end()) {
      if (follows(term)) continue;
      EXPECT_LE(most[t], rounding_w);
      EXPECT_GE(least[t], -rounding_w);
      continue;
    }
    switch (answer->second) {
      case Answer::loses:
        EXPECT_GT(most[t], 1e-3);
        EXPECT_GE(least[t], -rounding_w);
        break;
      case Answer::returns:
        EXPECT_LT(least[t], -1e-3);
        EXPECT_LE(most[t], rounding_w);
        break;
      case Answer::exchanges:
        EXPECT_GT(most[t], 1e-3);
        EXPECT_LT(least[t], -1e-3);
        break;
    }
  }
}

TEST_P(EffectEverywhere, ForwardModelInvertsVoltages) {
  const DriveModel model = model_with(GetParam());
  std::mt19937 random(12);
  for (int k = 0; k < 200; ++k) {
    Instant at = testing::random_motion(random);
    at.current_slope_a_s = {};  // as in forward motion without inductance
    const auto flow = model.flow(at);
    dynamics::DriveState state;
    state.x_m = at.x_m, state.y_m = at.y_m, state.heading_rad = at.heading_rad;
    state.climb_rad = at.climb_rad;
    state.wheel_speed_rad_s = at.wheel_speed_rad_s;
    state.copper_heat_w = at.copper_heat_w;
    state.current_a = flow.current_a;  // sustained by inductance
    const auto change = dynamics::derivative(model, state, at.payload_kg, 0, flow.voltage_v);
    const auto current = dynamics::algebraic_current(model, state, flow.voltage_v);
    for (std::size_t s : {0u, 1u}) {
      EXPECT_NEAR(current[s], flow.current_a[s], 1e-8 * (1 + std::fabs(flow.current_a[s])));
      EXPECT_NEAR(change.wheel_speed_rad_s[s], at.wheel_acceleration_rad_s2[s], 1e-6);
    }
  }
}

// Turns, braking, standstill, a payload and a route over the floor.
std::vector<signals::Sample> a_drive() {
  std::vector<signals::Sample> samples;
  double x = -2, y = -1, heading = 0.3;
  constexpr double rate_hz = 50;
  for (int k = 0; k < 1500; ++k) {
    const double t = k / rate_hz;
    signals::Sample s;
    s.utime_us = 1'700'000'000'000'000 + static_cast<std::int64_t>(std::llround(t * 1e6));
    s.sequence = k;
    const double w = 3 * (1 - std::cos(0.5 * t)), turn = 0.8 * std::sin(1.1 * t);
    s.wheel_velocity_rad_s = {w + turn, w - turn};
    s.payload_kg = 5;
    s.battery_voltage_v = 24.3;
    s.battery_current_a = 1.5;
    s.pose = {x, y, heading};
    s.pitch_rad = 0.06 * std::sin(0.7 * t);
    x += 0.1 * w * std::cos(heading) / rate_hz;
    y += 0.1 * w * std::sin(heading) / rate_hz;
    heading += 0.1 * turn / 0.165 / rate_hz;
    samples.push_back(s);
  }
  return samples;
}

TEST_P(EffectEverywhere, MeterMatchesInverseModel) {
  const robot::RobotModel robot = robot_with(GetParam());
  const DriveModel model = model_with(GetParam());
  const double thermal_k_w = model.parameters().thermal_resistance_k_w;
  energy::MeterSettings settings;
  double energy_j = 0, last_w = 0;
  std::size_t seen = 0;
  energy::Meter meter(model, settings, [&](const energy::MeterPoint& point) {
    // The heat of the winding appears as its temperature.
    std::array<double, 2> heat_w{};
    for (std::size_t s : {0u, 1u}) {
      if (thermal_k_w > 0) {
        heat_w[s] = (point.winding_temperature_c[s] - settings.winding_reference_c) / thermal_k_w;
      }
    }
    Instant at;
    at.wheel_speed_rad_s = point.sample.wheel_velocity_rad_s;
    at.wheel_acceleration_rad_s2 = point.wheel_acceleration_rad_s2;
    at.payload_kg = point.sample.payload_kg;
    at.x_m = point.sample.pose[0], at.y_m = point.sample.pose[1], at.heading_rad = point.sample.pose[2];
    at.climb_rad = point.sample.pitch_rad;
    at.copper_heat_w = heat_w;
    const double expected_w =
        model.metered_battery_power(model.flow(at).battery_power_w, point.sample.battery_voltage_v);
    EXPECT_NEAR(point.modelled_power_w, expected_w, 1e-7 * (1 + std::fabs(expected_w)));
    if (seen++ > 0) energy_j += 0.5 * (last_w + expected_w) * point.interval_s;
    last_w = expected_w;
  });
  for (const auto& sample : a_drive()) ASSERT_TRUE(meter.add(sample));
  ASSERT_TRUE(meter.flush());
  EXPECT_EQ(seen, 1500u);
  // The error of the trapezoid rule, from the curvature of power, is below 1e-3 of the energy here.
  EXPECT_NEAR(meter.accounts().modelled_j, energy_j, 1e-3 * std::fabs(energy_j));
}

double planned_power_w(const planning::Electric& e, const planning::WheelLoads& loads, double speed,
                       double acceleration) {
  double power_w = e.idle_w;
  for (std::size_t s : {0u, 1u}) {
    const planning::WheelLoad& w = loads[s];
    const double tau = w.inertia * acceleration + w.t0 + w.t1 * speed + w.t2 * speed * speed +
                       w.scrub * std::tanh(speed / w.scrub_speed);
    const double x = speed / w.stribeck_speed;
    const double torque = tau + w.gear * std::fabs(tau) + w.f0 + w.f1 * speed + w.f2 * speed * speed +
                          w.stribeck * std::exp(-std::pow(x, w.stribeck_exponent));
    const double motor_w = e.copper_w_n2_m2[s] * torque * torque + e.back_emf * w.pace * speed * torque +
                           e.brush_w_nm * std::fabs(torque);
    power_w += (motor_w > 0 ? e.up : e.down) * motor_w;
  }
  return power_w;
}

void expect_planned(const robot::RobotModel& robot) {
  const auto loads = planning::DriveLoads::make(robot, std::nullopt);
  ASSERT_TRUE(loads) << describe(loads.error());
  std::vector<planning::Run> runs(3);
  runs[0].knots = {{0, 0, {0, 0, 0.4}}, {4, 0, {3.7, 1.6, 0.4}}};
  runs[1].turn = -1;
  runs[1].knots = {{0, 0, {0, 0, 0.4}}, {2, 0, {0, 0, -1.6}}};
  runs[2].knots = {{0, 0.5, {0, 0, 0.4}}, {2, 0.5, {1.6, 1.4, 1.4}}};
  for (planning::Run& run : runs) {
    run.payload_kg = 6;
    const planning::Place place{run.knots.front()};
    const planning::WheelLoads wheels = loads->at(run, place);
    for (const double speed : {0.3, 0.6, 0.9}) {
      for (const double acceleration : {-0.3, 0.0, 0.3}) {
        const Instant at = loads->instant(run, place, speed, acceleration);
        const auto flow = loads->model().flow(at);
        EXPECT_NEAR(planned_power_w(loads->electric(), wheels, speed, acceleration), flow.battery_power_w,
                    1e-3 * std::fabs(flow.battery_power_w))
            << "turn " << run.turn << " speed " << speed << " acceleration " << acceleration;
      }
    }
  }
}

TEST_P(EffectEverywhere, PlannerMatchesInverseModel) {
  expect_planned(robot_with(GetParam()));
}

TEST_P(EffectEverywhere, PlansWithEveryOther) {
  for (const Effect* other : dynamics::catalogue()) {
    if (other == GetParam()) continue;
    robot::RobotModel robot = robot_with(GetParam());
    robot.effects.push_back(robot_with(other).effects.front());
    SCOPED_TRACE(other->info().id);
    expect_planned(robot);
  }
}

// Part of the gear's loss is proportional to friction.
TEST(EffectsTogether, PlansGearLossesOnFriction) {
  for (const double of_friction : {0.0, 0.4, 1.0}) {
    robot::RobotModel robot = robot_with(nullptr);
    robot.effects = {{"gear_efficiency", {{"loss", 0.2}, {"of_friction", of_friction}}},
                     {"stribeck_friction", {{"ratio", 0.5}, {"speed_rad_s", 3.0}}}};
    expect_planned(robot);
  }
}

}  // namespace
}  // namespace joulecast
