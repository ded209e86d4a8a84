#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "gap/diagnose/recordings.h"
#include "gap/posterior/functions.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/answer.h"
#include "tests/gap/posterior/made_robot.h"

// Kinds of failure that were seen on real recordings, each in the smallest case that shows it.
namespace joulecast::gap::posterior {
namespace {

using made::Drives;

bool stands_for(const ExplainedBy& e, std::string_view id) {
  return e.id == id || std::ranges::find(e.alternatives, id) != e.alternatives.end();
}

bool names(const Explained& a, std::string_view id) {
  return std::ranges::any_of(a.effects,
                             [&](const ExplainedBy& e) { return e.group >= named && stands_for(e, id); });
}

dynamics::ActiveEffect effect_of(std::string_view id, double strength) {
  dynamics::ActiveEffect active = dynamics::initial(*dynamics::find_effect(id));
  active.values[0] = strength;
  return active;
}

TEST(Pairs, NamesBothEffects) {
  Drives drives(21);
  drives.planted = {effect_of("coulomb_friction", 0.6)};
  drives.load_w = [](double) { return 8.0; };
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  EXPECT_TRUE(names(*a, "coulomb_friction"));
  EXPECT_TRUE(names(*a, "accessory_load"));
}

TEST(MakeFunctions, OneMissionHasNoTime) {
  Drives drives(22);
  telemetry::RecordingSet recordings = drives.recordings();
  const auto of_time = [&] {
    return std::ranges::count(make_functions(*make_data(recordings.missions, drives.robot)), "time",
                              &Function::variable);
  };
  EXPECT_GT(of_time(), 0);
  recordings.missions.resize(1);
  EXPECT_EQ(of_time(), 0);
}

// A constant load is an effect of the catalogue, no function outside it.
TEST(MakeFunctions, LeaveOutConstant) {
  const Drives drives(22);
  const telemetry::RecordingSet recordings = drives.recordings();
  int count = 0;
  for (const Function& f : make_functions(*make_data(recordings.missions, drives.robot))) {
    if (f.channel != Channel::power) continue;
    EXPECT_LT(f.basis[0].colwise().mean().cwiseAbs().maxCoeff(), 1e-12) << f.variable;
    ++count;
  }
  EXPECT_GT(count, 0);
}

// A logger of a reading in 5 s, with the height: the climb is a cause, beside a friction that is too small in
// the file.
TEST(SlowRows, NameClimbAndFriction) {
  Drives drives(31);
  constexpr double step_s = 5, row_s = 0.05;
  const dynamics::DriveModel model(drives.robot, std::vector{effect_of("coulomb_friction", 1)});
  const double weight_n = drives.robot.total_mass_kg(0) * robot::standard_gravity_m_s2;
  std::mt19937_64 random(31);
  std::normal_distribution<double> noise(0, 1);
  telemetry::RecordingSet recordings = drives.recordings();
  for (std::size_t m = 0; m < recordings.missions.size(); ++m) {
    telemetry::Recording& mission = recordings.missions[m];
    mission.samples.clear();
    signals::CovariateSeries height{"height_m", {}, {}};
    double way_m = 0, height_m = 10;
    for (int k = 0; k < 72'000; ++k) {
      const double t = row_s * k, phase = 0.7 * static_cast<double>(m);
      const auto speed = [&](double at) { return 4 + 2 * std::sin(at / 37 + phase) + std::sin(at / 15.5); };
      const double climb_rad = 0.04 * std::sin(way_m / 20 + phase), v = 0.1 * speed(t);
      Window w;
      w.speed_rad_s = {speed(t), speed(t)};
      const double a = (speed(t + 0.01) - speed(t - 0.01)) / 0.02;
      w.acceleration_rad_s2 = {a, a};
      w.battery_voltage_v = 24;
      const double up_w = weight_n * v * std::sin(climb_rad);
      way_m += v * row_s;
      height_m += v * row_s * std::sin(climb_rad);
      if (k % static_cast<int>(step_s / row_s) != 50) continue;
      signals::Sample s;
      s.utime_us = 1'700'000'000'000'000 + std::llround(1e6 * (t + 10'000.0 * static_cast<double>(m)));
      s.sequence = static_cast<std::int64_t>(mission.samples.size());
      s.wheel_velocity_rad_s = w.speed_rad_s;
      s.battery_voltage_v = 24;
      s.battery_current_a = (metered_powers(model, w).battery_w + up_w + noise(random)) / 24;
      mission.samples.push_back(s);
      height.utime_us.push_back(s.utime_us);
      height.value.push_back(height_m);
    }
    mission.covariates = {height};
  }
  const auto set = telemetry::make_recording_set(drives.robot.robot_id, std::move(recordings.missions));
  ASSERT_TRUE(set);
  const auto a = explain_recordings(*set, drives.robot);
  ASSERT_TRUE(a);
  EXPECT_TRUE(names(*a, "grade")) << name_of(a->verdict);
  EXPECT_TRUE(names(*a, "coulomb_friction")) << name_of(a->verdict);
}

// A file with twice the friction of the robot: the estimate is half of the file's.
TEST(DetectionLimit, SeesTooMuchFriction) {
  Drives drives(32);
  const telemetry::RecordingSet recordings = drives.recordings();
  for (double& t : drives.robot.motor.friction_torque_nm) t *= 2;
  const auto a = explain_recordings(recordings, drives.robot);
  ASSERT_TRUE(a);
  const auto friction = std::ranges::find(a->effects, "coulomb_friction", &ExplainedBy::id);
  ASSERT_NE(friction, a->effects.end());
  EXPECT_GT(friction->group, 0.9);
  EXPECT_NEAR(friction->parameters.front().value, -0.5, 3 * friction->parameters.front().deviation);
}

// The limit is that of the effects that are hard to see, 3.5 deviations of the estimate: twice as much is
// named.
TEST(DetectionLimit, IsNearTheDeviation) {
  Drives drives(23);
  const auto sound = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(sound);
  EXPECT_LT(sound->detectable, detectable);
  const auto data = make_data(drives.recordings().missions, drives.robot);
  const double planted_w = 2 * sound->detectable * data->mean_power_w;
  ASSERT_GT(planted_w, 0);
  drives.load_w = [=](double) { return planted_w; };
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  EXPECT_TRUE(names(*a, "accessory_load"))
      << planted_w << " W of " << data->mean_power_w << " W: " << name_of(a->verdict);
}

// An array on the roof gives more power than the base load: the vehicle does not become light.
TEST(Sources, SupplyIsNotMass) {
  Drives drives(24);
  drives.load_w = [&](double) { return -2 * drives.robot.idle_power_w; };
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  for (const ExplainedBy& e : a->effects) {
    EXPECT_TRUE(e.group < 0.9 || stands_for(e, "accessory_load") || stands_for(e, "current_sensor_bias"))
        << e.id;
  }
  const auto supply = std::ranges::find(a->effects, "accessory_load", &ExplainedBy::id);
  ASSERT_NE(supply, a->effects.end());
  EXPECT_GT(supply->group, 0.9);
  EXPECT_NEAR(supply->parameters.front().value, drives.load_w(0),
              3 * supply->parameters.front().deviation + 0.3);
  const auto mass = std::ranges::find_if(
      a->model, [](const auto& e) { return e.effect->info().id == "chassis_mass_error"; });
  EXPECT_TRUE(mass == a->model.end() || std::fabs(mass->values[0]) < 0.1);
}

// A lamp that is on while the robot turns.
TEST(OutsideCatalogue, LampFollowsYawRate) {
  Drives drives(26);
  drives.load_w = [](double t) { return Drives::speed(t, 0) - Drives::speed(t, 1) > 0.1 ? 20.0 : 0.0; };
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  EXPECT_EQ(a->verdict, Verdict::outside);
  EXPECT_EQ(a->outside.follows, "yaw_rate");
}

// Grease that warms up loads a moving wheel: a function of time names where the gap is, though it has not its
// form.
TEST(OutsideCatalogue, ColdGreaseFollowsTime) {
  Drives drives(27);
  drives.load_w = [](double t) {
    return 0.5 * Drives::speed(t, 0) * Drives::speed(t, 0) * std::exp(-std::fmod(t, 80) / 20);
  };
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  EXPECT_EQ(a->verdict, Verdict::outside);
  EXPECT_EQ(a->outside.follows, "time");
}

// Adds the poses of a robot on wheels `times` as large as the file's.
void add_poses(double times, const robot::RobotModel& robot, telemetry::RecordingSet& recordings) {
  std::mt19937_64 random(28);
  std::normal_distribution<double> noise(0, 0.003);
  const double r = times * robot.kinematics.wheel_radius_m, l = robot.kinematics.half_track_m;
  for (telemetry::Recording& mission : recordings.missions) {
    std::array<double, 3> pose{};
    for (signals::Sample& s : mission.samples) {
      const auto [right, left] = std::pair(s.wheel_velocity_rad_s[0], s.wheel_velocity_rad_s[1]);
      pose[2] += r * (right - left) / (2 * l) * 0.05;
      pose[0] += r * (right + left) / 2 * 0.05 * std::cos(pose[2]);
      pose[1] += r * (right + left) / 2 * 0.05 * std::sin(pose[2]);
      for (const std::size_t k : {0u, 1u, 2u}) s.pose[k] = pose[k] + noise(random);
    }
  }
}

// A pose that moves 0.9 times as far as the wheels of the file, with battery power.
TEST(WheelRadius, IsFoundByPose) {
  Drives drives(28);
  drives.planted = {effect_of("wheel_radius_error", -0.1)};
  telemetry::RecordingSet recordings = drives.recordings();
  add_poses(0.9, drives.robot, recordings);
  const auto a = explain_recordings(recordings, drives.robot);
  ASSERT_TRUE(a);
  const auto radius = std::ranges::find(a->effects, "wheel_radius_error", &ExplainedBy::id);
  ASSERT_NE(radius, a->effects.end());
  EXPECT_GT(radius->group, 0.9);
  EXPECT_NEAR(radius->parameters.front().value, -0.1, 0.02);
  EXPECT_FALSE(names(*a, "linear_inertia_error"));
}

// The file holds half the radius: with poses the robot is known, without them mass and radius have one
// effect.
TEST(WheelRadius, HalfOfItIsNoMass) {
  Drives drives(33);
  telemetry::RecordingSet recordings = drives.recordings();
  robot::RobotModel file = drives.robot;
  file.kinematics.wheel_radius_m /= 2;
  const auto by_power = diagnose(recordings, file, {});
  ASSERT_TRUE(by_power);
  for (const DiagnosedEffect& e : by_power->effects) EXPECT_LT(e.probability, 0.9) << e.id;
  EXPECT_EQ(std::ranges::count(by_power->checks, "wheel_radius_scale", &Check::id), 1);
  add_poses(2, file, recordings);
  const auto d = diagnose(recordings, file, {});
  ASSERT_TRUE(d);
  const auto corrected = take(offer_of(*d), file);
  ASSERT_TRUE(corrected) << describe(corrected.error());
  EXPECT_EQ(std::ranges::count(d->checks, "track_against_gyro", &Check::id), 0);
  const auto p = dynamics::drive_model(*corrected)->parameters();
  EXPECT_NEAR(p.wheel_radius_m[0] / drives.robot.kinematics.wheel_radius_m, 1, 0.01);
  EXPECT_NEAR(p.friction_torque_nm[0] / file.motor.friction_torque_nm[0], 1, 0.05);
}

// Acceleration is the derivative of a speed that only noise changes.
TEST(NoisySpeed, MassStaysUnknown) {
  Drives drives(25);
  telemetry::RecordingSet recordings = drives.recordings();
  const dynamics::DriveModel model(drives.robot, {});
  std::mt19937_64 random(25);
  std::normal_distribution<double> normal;
  Window w;
  w.speed_rad_s = {6, 6};
  w.battery_voltage_v = 24;
  const double power_w = metered_powers(model, w).battery_w;
  for (telemetry::Recording& mission : recordings.missions) {
    for (signals::Sample& s : mission.samples) {
      for (double& speed : s.wheel_velocity_rad_s) speed = 6 + 0.1 * normal(random);
      s.battery_current_a = (power_w + normal(random)) / 24;
    }
  }
  robot::RobotModel heavy = drives.robot;
  heavy.mass.chassis_kg *= 2;
  const auto a = explain_recordings(recordings, heavy);
  ASSERT_TRUE(a);
  EXPECT_FALSE(names(*a, "chassis_mass_error"));
}

// Noise of the speeds that is about as large in the acceleration as the motion's own. A regression of the
// power on that of one more kilogram finds the file's mass to be right.
TEST(NoisySpeed, MassIsNotAttenuated) {
  Drives drives(34);
  telemetry::RecordingSet recordings = drives.recordings();
  std::mt19937_64 random(34);
  std::normal_distribution<double> noise(0, 2);
  for (telemetry::Recording& mission : recordings.missions)
    for (signals::Sample& s : mission.samples)
      for (double& speed : s.wheel_velocity_rad_s) speed += noise(random);
  const auto data = make_data(recordings.missions, drives.robot);
  ASSERT_TRUE(data);
  const Eigen::VectorXd own_w = predicted_power(*data, {}), left_w = data->rows.measured_w() - own_w,
                        per_kg =
                            predicted_power(*data, std::vector{effect_of("chassis_mass_error", 0.1)}) - own_w;
  const Eigen::ArrayXd x = per_kg.array() - per_kg.mean();
  const double share = 0.1 * (x * left_w.array()).sum() / x.square().sum();
  EXPECT_NEAR(share, 0, 0.1);
}

// Rows of every n-th sample, with means of the current since the last row.
TEST(SlowRows, MeansAreOfIntervals) {
  const Drives drives(37);
  for (const std::size_t nth : {20u, 4u}) {  // 1 and 5 Hz
    telemetry::RecordingSet recordings = drives.recordings();
    for (telemetry::Recording& mission : recordings.missions) {
      std::vector<signals::Sample> kept;
      double sum_a = 0;
      for (std::size_t k = 1; k < mission.samples.size(); ++k) {
        sum_a += mission.samples[k].battery_current_a;
        if (k % nth != 0) continue;
        kept.push_back(mission.samples[k]);
        kept.back().battery_current_a = sum_a / static_cast<double>(nth);
        sum_a = 0;
      }
      mission.samples = std::move(kept);
    }
    const auto data = make_data(recordings.missions, drives.robot);
    ASSERT_TRUE(data && data->power);
    const Eigen::VectorXd missed_w = predicted_power(*data, {}) - data->rows.measured_w();
    EXPECT_LT(missed_w.cwiseAbs().mean(), 0.02 * data->mean_power_w) << nth;
  }
}

// A meter that answers late, and one that leads wheel speeds that are filtered.
TEST(LatePower, FindsMotionOfReadings) {
  const Drives drives(38);
  for (const int late : {-3, 3}) {  // rows of 0.05 s
    telemetry::RecordingSet recordings = drives.recordings();
    for (telemetry::Recording& mission : recordings.missions) {
      const std::vector<signals::Sample> sent = mission.samples;
      const auto count = static_cast<int>(sent.size());
      for (int k = 0; k < count; ++k)
        mission.samples[static_cast<std::size_t>(k)].battery_current_a =
            sent[static_cast<std::size_t>(std::clamp(k - late, 0, count - 1))].battery_current_a;
    }
    const auto data = make_data(recordings.missions, drives.robot);
    ASSERT_TRUE(data && data->power);
    const Eigen::VectorXd missed_w = predicted_power(*data, {}) - data->rows.measured_w();
    EXPECT_LT(missed_w.cwiseAbs().mean(), 0.02 * data->mean_power_w) << late;
  }
}

// Currents of the motors on a sloping floor, by a robot with these effects, and noise of the speeds. Every
// other mission carries a payload, with a yaw inertia of `gyration_m2` a kilogram.
telemetry::RecordingSet noisy_currents(const Drives& drives,
                                       const std::vector<dynamics::ActiveEffect>& effects,
                                       double payload_kg = 0,
                                       double gyration_m2 = robot::payload_yaw_inertia_m2) {
  telemetry::RecordingSet recordings = drives.recordings();
  std::mt19937_64 random(36);
  std::normal_distribution<double> noise(0, 0.03);
  for (std::size_t m = 0; m < recordings.missions.size(); ++m) {
    telemetry::Recording& mission = recordings.missions[m];
    mission.payload_kg = m % 2 == 0 ? 0 : payload_kg;
    auto own = effects;
    own.push_back(
        effect_of("yaw_inertia_error", (gyration_m2 - robot::payload_yaw_inertia_m2) * mission.payload_kg /
                                           drives.robot.mass.yaw_inertia_kg_m2));
    const dynamics::DriveModel model(drives.robot, std::move(own));
    for (signals::Sample& s : mission.samples) {
      const double t = 1e-6 * static_cast<double>(s.utime_us % 1'000'000'000);
      const auto speed = [&](std::size_t side, double at) { return Drives::speed(at, side); };
      s.pitch_rad = 0.05 * std::sin(t / 7);
      dynamics::Instant at;
      at.climb_rad = s.pitch_rad;
      at.payload_kg = mission.payload_kg;
      for (const std::size_t k : {0u, 1u}) {
        at.wheel_speed_rad_s[k] = speed(k, t);
        at.wheel_acceleration_rad_s2[k] = (speed(k, t + 1e-3) - speed(k, t - 1e-3)) / 2e-3;
        s.wheel_velocity_rad_s[k] = at.wheel_speed_rad_s[k] + noise(random);
      }
      const auto flow = model.flow(at);
      s.motor_current_a = flow.current_a;
      for (const std::size_t k : {0u, 1u}) s.motor_voltage_v[k] = model.voltage_for(k, flow.current_a[k], at);
      s.battery_current_a = (flow.battery_power_w + 30 * noise(random)) / s.battery_voltage_v;
    }
  }
  return recordings;
}

Drives scrubbing_drives() {
  Drives drives(36);
  drives.robot.effects.push_back({"turning_scrub", {{"coefficient", 0.03}, {"rate_rad_s", 0.05}}});
  return drives;
}

// A step of the linear equations to a payload and an inertia in place of the grade predicts power worse than
// the file does.
TEST(NoisySpeed, GradeIsNoPayload) {
  const Drives drives = scrubbing_drives();
  auto effects = *dynamics::active_effects(drives.robot);
  effects.push_back(effect_of("grade", 1));
  const auto fit = fit_missions(noisy_currents(drives, effects).missions, drives.robot);
  ASSERT_TRUE(fit);
  EXPECT_LT(missed((*fit)->data, power_of(**fit, (*fit)->equations.point)), 0.5 * (*fit)->gap);
  const auto a = explain(**fit);
  EXPECT_TRUE(names(a, "grade"));
  EXPECT_FALSE(names(a, "payload_mass_error"));
}

// The file is exact. While the robot goes straight on, yaw rate and acceleration are noise alone, which the
// currents do not follow: a larger mass with a smaller scrub and currents read later would use it.
TEST(NoisySpeed, ExactFileNeedsNoMass) {
  const Drives drives = scrubbing_drives();
  const auto recordings = noisy_currents(drives, *dynamics::active_effects(drives.robot));
  const auto a = explain_recordings(recordings, drives.robot);
  ASSERT_TRUE(a);
  ASSERT_TRUE(a->held_out.known);
  EXPECT_LT(a->held_out.explanation, a->held_out.file + 0.005);
  for (const ExplainedBy& e : a->effects) EXPECT_LT(e.bagged, named) << e.id;
}

// A pallet of 0.9 m by 0.6 m has five times the yaw inertia that the robot file assumes of a payload.
TEST(Payload, YawInertiaIsNoMass) {
  const Drives drives = scrubbing_drives();
  const auto recordings = noisy_currents(drives, *dynamics::active_effects(drives.robot), 10, 0.1);
  const auto a = explain_recordings(recordings, drives.robot);
  ASSERT_TRUE(a);
  for (const ExplainedBy& e : a->effects) EXPECT_LT(e.bagged, named) << e.id;
}

struct Offer {
  double regression, explanation;
  bool adopts;
};

Diagnosis offered(const Offer& offer) {
  Fit fit;
  fit.data.mean_power_w = 100;
  Explained a;
  a.verdict = Verdict::effects;
  a.probability = 1;
  a.model = {effect_of("accessory_load", 22)};
  ExplainedBy& e = a.effects.emplace_back();
  e.id = "accessory_load";
  e.probability = e.group = 1;
  e.parameters = {{"power_w", "W", 22, 0.4}};
  a.adopts = offer.adopts;
  a.held_out.known = true;
  a.held_out.file = 0.71;
  a.held_out.explanation = offer.explanation;
  a.held_out.regression = offer.regression;
  for (int b = 0; b < 8; ++b) a.held_out.blocks.push_back({0.71, offer.explanation, offer.regression, 1});
  Diagnosis d;
  d.noise_floor = 0.01;
  state_effects(a, 100, d);
  state_held_out(a.held_out, d);
  state_offer(fit, a, false, d);
  return d;
}

TEST(StateOffer, RegressionHasNoVeto) {
  const Diagnosis d = offered({.regression = 0.0025, .explanation = 0.07, .adopts = true});
  EXPECT_TRUE(d.refusal.empty()) << d.refusal;
  ASSERT_EQ(d.adoptable.size(), 1u);
  EXPECT_EQ(d.adoptable.front().id, "accessory_load");
  ASSERT_TRUE(d.shrinkage);
  EXPECT_NEAR(d.shrinkage->fraction, 1 - 0.07 / 0.71, 1e-12);
}

// A guessed file takes the offer and then predicts as the explanation does: no part that matters is
// left out.
TEST(StateOffer, PredictsAsTheExplanation) {
  Drives drives(29);
  drives.planted = {effect_of("coulomb_friction", 2), effect_of("chassis_mass_error", 0.6),
                    effect_of("viscous_friction", 3), effect_of("turning_scrub", 0.2)};
  drives.load_w = [](double) { return 30.0; };
  const telemetry::RecordingSet recordings = drives.recordings();
  const auto d = diagnose(recordings, drives.robot, {});
  ASSERT_TRUE(d && d->baseline);
  ASSERT_GT(d->power_absolute_relative, mismatched_file);
  EXPECT_TRUE(d->refusal.empty()) << d->refusal;
  const auto corrected = take(offer_of(*d), drives.robot);
  ASSERT_TRUE(corrected) << describe(corrected.error());
  const auto data = make_data(recordings.missions, *corrected);
  const Eigen::VectorXd left_w = data->rows.measured_w() - predicted_power(*data, data->in_file);
  EXPECT_LT(left_w.cwiseAbs().mean() / data->mean_power_w, d->baseline->explanation_held_out + least_effect);
}

TEST(StateOffer, RefusesWithOneNumber) {
  const Diagnosis d = offered({.regression = 0.6, .explanation = 0.705, .adopts = false});
  EXPECT_NE(d.refusal.find("reduce the held-out error by 0.5"), std::string::npos) << d.refusal;
}

}  // namespace
}  // namespace joulecast::gap::posterior
