#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "plausibility/evidence.h"
#include "tests/support/sample_robots.h"

namespace joulecast::plausibility {
namespace {

ChannelEvidence evidence(double ratio, std::initializer_list<std::pair<std::size_t, double>> exponents,
                         double off, double trust) {
  ChannelEvidence e;
  e.ratio = {ratio, 0.01 * std::fabs(ratio), 50};
  e.powers = exponents;
  e.off = {off, off};
  e.trust = trust;
  return e;
}

// Evidence of the gyro and the wheels, of the map and the wheels, and of the map and the gyro.
std::vector<ChannelEvidence> kinematics(double gyro, double wheels) {
  return {evidence(gyro / wheels, {{reading::yaw_rate, 1}, {reading::wheel_velocity, -1}}, 0.3, 8),
          evidence(gyro / wheels, {{reading::yaw_rate, 1}, {reading::wheel_velocity + 1, -1}}, 0.3, 8),
          evidence(1 / wheels, {{reading::x, 1}, {reading::wheel_velocity, -1}}, 0.2, 8),
          evidence(1 / wheels, {{reading::x, 1}, {reading::wheel_velocity + 1, -1}}, 0.2, 8),
          evidence(1 / gyro, {{reading::heading, 1}, {reading::yaw_rate, -1}}, 0.1, 12)};
}

class Faults : public ::testing::Test {
 protected:
  robot::RobotModel robot_ = testing::nomad();
  std::vector<ChannelFault> faults_ = known_faults(robot_);
};

TEST_F(Faults, ReturnsNoneForSoundEvidence) {
  for (const double off : {0.75, 1.0, 1.3}) {
    const auto some = kinematics(off, 1);
    EXPECT_TRUE(explain_faults(some, faults_).faults.empty()) << off;
  }
}

TEST_F(Faults, NamesFaultExplainingAllEvidence) {
  struct Case {
    double gyro, wheels;
    const char* id;
    double factor;
  };
  const double degrees = 180 / std::numbers::pi, rpm = 30 / std::numbers::pi;
  for (const Case& c : {Case{1.1 * degrees, 1, "yaw_rate_scale", 1.1 * degrees},
                        Case{-1, 1, "yaw_rate_reversed", -1}, Case{1, rpm, "wheel_velocity_scale", rpm},
                        Case{0.95, 1.05 * robot_.kinematics.wheel_radius_m, "wheel_velocity_scale", 0.105}}) {
    const auto some = kinematics(c.gyro, c.wheels);
    const FaultExplanation explanation = explain_faults(some, faults_);
    ASSERT_EQ(explanation.faults.size(), 1u) << c.id;
    EXPECT_EQ(explanation.faults[0]->id, c.id);
    const Measured measured = measured_factor(some, explanation, *explanation.faults[0]);
    EXPECT_NEAR(measured.factor, c.factor, 0.15 * std::fabs(c.factor));
    EXPECT_LE(measured.interval[0], measured.factor);
    EXPECT_GE(measured.interval[1], measured.factor);
  }
}

// Of two hypotheses, one costs 3.5 nats and the other 4.5.
TEST_F(Faults, StatesProbabilityOfEachFault) {
  const auto sure = explain_faults(kinematics(-1, 1), faults_);
  ASSERT_EQ(sure.probability.size(), 1u);
  EXPECT_GT(sure.probability[0], 0.97);
  std::vector<ChannelFault> two;
  for (const ChannelFault& f : faults_) {
    if (f.id == "yaw_rate_reversed" || (f.id == "wheel_velocity_reversed" && f.channel == "wheel_velocity"))
      two.push_back(f);
  }
  ASSERT_EQ(two.size(), 2u);
  const auto all = kinematics(-1, 1);
  const auto open = explain_faults(std::span(all.data(), 2), two);
  ASSERT_EQ(open.probability.size(), 1u);
  // Without a fault both pieces of evidence cost their full trust, 8 nats each.
  EXPECT_NEAR(open.probability[0], 1 / (1 + std::exp(-1.0) + std::exp(3.5 - 16)), 1e-9);
}

// Heavy tails: 2 log(1 + z^2/3) nats, with the misfit of the evidence's fit in the scale.
double heavy(double ratio, double scale) {
  return 2 * std::log1p(std::pow(std::log(ratio), 2) / (3 * (scale * scale + 0.01 * 0.01)));
}

ChannelEvidence heavy_evidence(double ratio, std::initializer_list<std::pair<std::size_t, double>> exponents,
                               double scale) {
  ChannelEvidence e = evidence(ratio, exponents, scale, 30);
  e.heavy_tails = e.magnitude = e.by_power = e.both_sides = true;
  return e;
}

// A tenth of the current moves friction, mass and internal resistance by one factor; wheels in km/h move
// friction and mass by its square and leave the resistance.
TEST_F(Faults, WeighsCurrentAgainstWheels) {
  const auto part = [](double scale) {
    return heavy_evidence(0.1, {{reading::battery_current, 1}, {reading::wheel_velocity, -2}}, scale);
  };
  std::vector<ChannelEvidence> all{part(0.5), part(0.2),
                                   heavy_evidence(10, {{reading::battery_current, -1}}, 0.7)};
  std::vector<ChannelFault> two;
  for (const ChannelFault& f : faults_)
    if (f.cause == "a tenth of the true one" || f.cause == "computed from km/h as if they were m/s")
      two.push_back(f);
  ASSERT_EQ(two.size(), 2u);
  const FaultExplanation found = explain_faults(all, two);
  ASSERT_EQ(found.faults.size(), 1u);
  EXPECT_EQ(found.faults[0]->channel, "battery_current");
  const double none = heavy(0.1, 0.5) + heavy(0.1, 0.2) + heavy(10, 0.7), tenth = 5.5;
  const double left = 0.1 * 3.6 * 3.6, wheels = 4 + heavy(left, 0.5) + heavy(left, 0.2) + heavy(10, 0.7);
  EXPECT_NEAR(found.probability[0], 1 / (1 + std::exp(tenth - none) + std::exp(tenth - wheels)), 1e-9);
  EXPECT_NEAR(found.any[0],
              1 - std::exp(tenth - none) / (1 + std::exp(tenth - none) + std::exp(tenth - wheels)), 1e-9);
  // A misfit as large as the parts themselves leaves nothing to conclude.
  for (ChannelEvidence& e : all) e.unexplained = 3;
  EXPECT_TRUE(explain_faults(all, two).faults.empty());
}

// A radius of half the robot's moves the map's way by its inverse and the power of acceleration by its
// inverse square, as wheels that are counted half do, but not the power of friction.
TEST_F(Faults, WeighsRadiusAgainstWheels) {
  const auto part = [](double ratio, double radius, double scale) {
    return heavy_evidence(ratio, {{reading::wheel_velocity, -radius}, {half_radius, -radius}}, scale);
  };
  std::vector<ChannelEvidence> all{part(2, 1, 0.2), part(4, 2, 0.2)};
  std::vector<ChannelFault> two;
  for (const ChannelFault& f : faults_)
    if (f.channel == radius_of_file || f.cause == "counted half (0.5 times the motion)") two.push_back(f);
  ASSERT_EQ(two.size(), 3u);
  const double none = heavy(2, 0.2) + heavy(4, 0.2), half = 5.5;
  EXPECT_NEAR(explain_faults(all, two).probability.at(0), 1 / (2 + std::exp(half - none)), 1e-9);
  all.push_back(heavy_evidence(1, {{reading::wheel_velocity, -2}}, 0.5));
  const FaultExplanation found = explain_faults(all, two);
  ASSERT_EQ(found.faults.size(), 1u);
  EXPECT_EQ(found.faults[0]->id, "wheel_radius_scale");
  EXPECT_NEAR(found.probability[0], 1 / (1 + std::exp(half - none) + std::exp(-heavy(4, 0.5))), 1e-9);
  EXPECT_NEAR(measured_factor(all, found, *found.faults[0]).factor, 0.5, 1e-9);
}

// Factors within a fifth of each other are one fault: km/h for m/s, and feet.
TEST_F(Faults, AddsNearlyEqualFactors) {
  const std::vector<ChannelEvidence> some{heavy_evidence(1 / 3.6, {{reading::wheel_velocity, -1}}, 0.05),
                                          heavy_evidence(1 / 3.6, {{reading::wheel_velocity, -1}}, 0.05)};
  std::vector<ChannelFault> two;
  for (const ChannelFault& f : faults_)
    if (f.cause.find("km/h as if") != std::string::npos || f.cause.find("feet") != std::string::npos)
      two.push_back(f);
  ASSERT_EQ(two.size(), 2u);
  const FaultExplanation found = explain_faults(some, two);
  ASSERT_EQ(found.faults.size(), 1u);
  EXPECT_NE(found.faults[0]->cause.find("km/h"), std::string::npos);
  const double none = std::exp(4 - 2 * heavy(3.6, 0.05)),
               feet = std::exp(4 - 5.5 - 2 * heavy(3.6 / 3.2808, 0.05));
  EXPECT_NEAR(found.probability[0], (1 + feet) / (1 + feet + none), 1e-9);
}

// Wheels at half their speed, with a radius of 0.4 m: neither "half" nor "in m/s at the rim" is certain, but
// one of them is.
TEST_F(Faults, AddsFactorsOfOneChannel) {
  robot_.kinematics.wheel_radius_m = 0.4;
  const std::vector<ChannelEvidence> some{heavy_evidence(2, {{reading::wheel_velocity, -1}}, 0.1),
                                          heavy_evidence(2, {{reading::wheel_velocity, -1}}, 0.1)};
  std::vector<ChannelFault> two;
  for (const ChannelFault& f : known_faults(robot_))
    if (f.cause == "given in m/s at the rim" || f.cause == "counted half (0.5 times the motion)")
      two.push_back(f);
  ASSERT_EQ(two.size(), 2u);
  const FaultExplanation found = explain_faults(some, two);
  ASSERT_EQ(found.faults.size(), 1u);
  const double none = std::exp(-2 * heavy(2, 0.1)), rim = std::exp(-4 - 2 * heavy(2 * 0.4, 0.1)),
               half = std::exp(-5.5 - 2 * heavy(1, 0.1));
  EXPECT_NEAR(found.probability[0], std::max(rim, half) / (none + rim + half), 1e-9);
  EXPECT_NEAR(found.any[0], (rim + half) / (none + rim + half), 1e-9);
  EXPECT_LT(found.probability[0], 0.95);
  EXPECT_GT(found.any[0], 0.98);
}

// Evidence that is as likely with the error as without it, prior included: a probability of one half is told.
TEST_F(Faults, TellsUncertainError) {
  const auto reversed = std::ranges::find(faults_, "yaw_rate_reversed", &ChannelFault::id);
  const std::vector<ChannelFault> one{*reversed};
  for (const double trust : {reversed->surprise - 2, reversed->surprise, reversed->surprise + 1}) {
    const std::vector<ChannelEvidence> some{evidence(-1, {{reading::yaw_rate, 1}}, 0.3, trust)};
    const double error = 1 / (1 + std::exp(reversed->surprise - trust));
    const FaultExplanation found = explain_faults(some, one);
    const bool told = error > 0.2;
    EXPECT_EQ(found.faults.size(), told ? 1u : 0u) << trust;
    if (told) {
      EXPECT_NEAR(found.any.at(0), error, 1e-9);
    }
  }
}

// The map's distance is 3 times that of wheels and gyro. Wheel speeds in m/s would explain most of it, but by
// a factor other than the measured one.
TEST_F(Faults, NamesOddPoseScale) {
  robot_.kinematics.wheel_radius_m = 0.292;
  std::vector<ChannelEvidence> some = kinematics(1, 1);
  for (ChannelEvidence& e : some) {
    if (e.power_of(reading::x) == 1) e.ratio = {2.98, 0.08, 50};
  }
  some.push_back(some[2]);
  some.back().magnitude = some.back().both_sides = true;
  const std::vector<ChannelFault> faults = known_faults(robot_, some);
  const FaultExplanation explanation = explain_faults(some, faults);
  ASSERT_EQ(explanation.faults.size(), 1u);
  EXPECT_EQ(explanation.faults[0]->id, "pose_scale");
  EXPECT_NEAR(measured_factor(some, explanation, *explanation.faults[0]).factor, 2.98, 0.01);
}

TEST_F(Faults, FindsTwoFaultsTogether) {
  const auto some = kinematics(-1, 30 / std::numbers::pi);
  const FaultExplanation explanation = explain_faults(some, faults_);
  ASSERT_EQ(explanation.faults.size(), 2u);
  std::vector<std::string> ids{explanation.faults[0]->id, explanation.faults[1]->id};
  std::ranges::sort(ids);
  EXPECT_EQ(ids, (std::vector<std::string>{"wheel_velocity_scale", "yaw_rate_reversed"}));
}

// A factor of 0.4 is that of no unit, but that of rpm over this gear ratio.
TEST_F(Faults, RejectsTwoUnitsOfOneChannel) {
  robot_.motor.gear_ratio = 30 / std::numbers::pi / 0.4;
  const std::vector<ChannelFault> faults = known_faults(robot_);
  const FaultExplanation explanation = explain_faults(kinematics(1, 0.4), faults);
  EXPECT_LE(std::ranges::count(explanation.faults, "wheel_velocity", &ChannelFault::channel), 1);
}

// The battery current differs by a factor that matches no unit.
TEST_F(Faults, RejectsOddFactorAsUnit) {
  const std::vector<ChannelEvidence> some{evidence(3.3, {{reading::battery_current, 1}}, 1.1, 8),
                                          evidence(2.9, {{reading::battery_current, 1}}, 1.1, 6)};
  EXPECT_TRUE(explain_faults(some, faults_).faults.empty());
}

// A fault that only invalidates contradicting evidence explains nothing.
TEST_F(Faults, IgnoresFaultsThatInvalidateEvidence) {
  ChannelEvidence odd = evidence(0.02, {{reading::battery_voltage, 1}}, 0.5, 12);
  odd.lost_by = {reading::wheel_velocity};
  odd.both_sides = true;
  const std::vector<ChannelEvidence> some{odd};
  for (const ChannelFault* fault : explain_faults(some, faults_).faults) {
    EXPECT_FALSE(fault->channel.starts_with("wheel_velocity")) << fault->cause;
  }
}

TEST_F(Faults, NamesInseparableFaults) {
  // With gyro and wheels only, either may be reversed.
  const auto all = kinematics(-1, 1);
  const std::span<const ChannelEvidence> some(all.data(), 2);
  const FaultExplanation explanation = explain_faults(some, faults_);
  ASSERT_EQ(explanation.faults.size(), 1u);
  ASSERT_EQ(explanation.alternatives.size(), 1u);
  std::vector<std::string> names{explanation.faults[0]->id};
  for (const ChannelFault* f : explanation.alternatives[0]) names.push_back(f->id);
  EXPECT_NE(std::ranges::find(names, "yaw_rate_reversed"), names.end());
  EXPECT_NE(std::ranges::find(names, "wheel_velocity_reversed"), names.end());
}

// Speeds in rpm, or a gear ratio in the file that is too large by the same factor. Only evidence that is
// independent of the file separates them.
TEST_F(Faults, SeparatesGearRatioFromUnit) {
  const double rpm = 30 / std::numbers::pi;
  std::vector<ChannelEvidence> some{evidence(1 / rpm, {{reading::wheel_velocity, -1}}, 0.3, 12),
                                    evidence(1 / rpm, {{reading::wheel_velocity + 1, -1}}, 0.3, 12)};
  for (ChannelEvidence& e : some) e.by_gear = true;
  const auto measured = [&] {
    const FaultExplanation explanation = explain_faults(some, faults_);
    EXPECT_EQ(explanation.faults.size(), 1u);
    return measured_factor(some, explanation, *explanation.faults.at(0));
  };
  EXPECT_TRUE(measured().by_gear);
  EXPECT_NEAR(measured().factor, rpm, 0.1);
  std::ranges::copy(kinematics(1, rpm), std::back_inserter(some));
  EXPECT_FALSE(measured().by_gear);
}

}  // namespace
}  // namespace joulecast::plausibility
