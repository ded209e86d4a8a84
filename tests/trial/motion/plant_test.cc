#include "tests/study/trial/motion/plant.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tests/study/trial/motion/base_robot.h"
#include "tests/study/trial/motion/judged.h"
#include "tests/study/trial/motion/made_recording.h"
#include "tests/trial/motion/driven_log.h"

namespace joulecast::trial::motion {
namespace {

class Plant : public ::testing::Test {
 protected:
  Plant()
      : log_(motion_log_of(driven_missions(2, 300, 1,
                                           [](double v, double a, double yaw) {
                                             return 60 + 30 * std::fabs(v) + 40 * std::fabs(yaw) +
                                                    100 * v * a + 0.6 * std::pow(std::fabs(v), 3);
                                           }))),
        fit_(fit_log(log_)),
        file_(base_robot(log_, fit_.form, fit_.base)),
        instants_(log_.all_instants()) {
    virtual_robot::Rng rng(11);
    scene_ = scene_of(log_, fit_, rng);
  }

  double mean_gap(std::span<const Planted> planted) const {
    double added = 0, base = 0;
    for (const Instant& at : instants_) {
      added += std::fabs(planted_power(scene_, planted, at).read_w - base_power_w(fit_.form, fit_.base, at));
      base += std::fabs(base_power_w(fit_.form, fit_.base, at));
    }
    return added / base;
  }

  MotionLog log_;
  BaseFit fit_;
  robot::RobotModel file_;
  std::vector<Instant> instants_;
  Scene scene_;
};

TEST_F(Plant, ReturnsBasePowerWithoutEffects) {
  EXPECT_LT(mean_gap({}), 1e-12);
}

// These formulas and those of the catalogue were written independently; in the catalogue's forms they agree.
TEST_F(Plant, MatchesCatalogueForms) {
  std::set<std::string_view> seen;
  for (const Form& form : forms()) {
    if (!form.catalogue || form.form == "of the motor's whole torque") continue;
    seen.insert(form.id);
    const auto planted = planted_at(scene_, form, 0.05, false, instants_);
    ASSERT_TRUE(planted) << form.id;
    robot::RobotModel with = file_;
    const double r = file_.kinematics.wheel_radius_m;
    robot::AdoptedEffect effect{std::string(form.id), {{"", planted->strength}}};
    const auto name = [&](const char* of) { effect.parameters[0].first = of; };
    if (form.id == "accessory_load") name("power_w");
    if (form.id == "current_sensor_bias") name("bias_a");
    if (form.id == "current_sensor_gain") name("gain");
    if (form.id == "aerodynamic_drag") name("coefficient_n_s2_m2");
    if (form.id == "gear_efficiency") name("loss");
    if (form.id == "driver_loss" || form.id == "no_regeneration") name("fraction");
    if (form.id == "stribeck_friction") {
      effect.parameters.emplace_back("speed_rad_s", scene_.slow_m_s / r);
      effect.parameters.emplace_back("exponent", scene_.slow_exponent);
    }
    if (form.id == "turning_scrub") name("coefficient");
    if (effect.parameters[0].first.empty()) name("ratio");
    // Effects that the file already has increase.
    const auto had = std::ranges::find(with.effects, effect.id, &robot::AdoptedEffect::id);
    if (had != with.effects.end()) {
      had->parameters[0].second += planted->strength;
    } else {
      with.effects.push_back(effect);
    }
    const auto modelled_w = modelled_power_w(with, instants_);
    ASSERT_TRUE(modelled_w) << form.id << ": " << describe(modelled_w.error());
    double apart = 0, total = 0;
    for (std::size_t n = 0; n < instants_.size(); ++n) {
      apart += std::fabs((*modelled_w)[n] - planted_power(scene_, {&*planted, 1}, instants_[n]).read_w);
      total += std::fabs((*modelled_w)[n]);
    }
    // Tolerance for a gap of 5 %: copper, friction that fades at creep speed, and the rounded Stribeck curve.
    EXPECT_LT(apart / total, 0.003) << form.id;
  }
  EXPECT_EQ(seen.size(), 13u);
}

TEST_F(Plant, AddsRequestedGap) {
  for (const Form& form : forms()) {
    const auto planted = planted_at(scene_, form, 0.02, false, instants_);
    ASSERT_TRUE(planted) << form.id << ", " << form.form;
    EXPECT_NEAR(mean_gap({&*planted, 1}), 0.02, 1e-6) << form.id << ", " << form.form;
    if (const auto down = planted_at(scene_, form, 0.02, true, instants_)) {
      EXPECT_LT(down->strength, 0);
      EXPECT_NEAR(mean_gap({&*down, 1}), 0.02, 1e-6) << form.id;
    }
  }
}

TEST_F(Plant, RejectsImplausibleStrengths) {
  const auto refused = [&](std::string_view id, double gap, bool downward) {
    return !planted_at(scene_, *std::ranges::find(forms(), id, &Form::id), gap, downward, instants_);
  };
  EXPECT_TRUE(refused("no_regeneration", 5, false));
  EXPECT_TRUE(refused("driver_loss", 0.02, true));
  EXPECT_TRUE(refused("coulomb_friction", 0.9, true));
  EXPECT_FALSE(refused("coulomb_friction", 0.02, true));
}

TEST_F(Plant, MarksIndistinguishableEffects) {
  const auto of = [&](std::string_view id) {
    return *planted_at(scene_, *std::ranges::find(forms(), id, &Form::id), 0.05, false, instants_);
  };
  EXPECT_NEAR(likeness(scene_, of("accessory_load"), of("current_sensor_bias"), instants_), 1, 1e-9);
  EXPECT_LT(std::fabs(likeness(scene_, of("accessory_load"), of("linear_inertia_error"), instants_)), 0.7);
}

TEST_F(Plant, OutsideLoadsHaveMeanOne) {
  for (std::size_t k = 0; k < outside_load_count; ++k) {
    virtual_robot::Rng rng(k);
    const auto load = outside_load_w(static_cast<OutsideLoad>(k), instants_, rng);
    if (load.empty()) continue;  // too rare here
    double mean = 0, absolute = 0;
    for (const double w : load) {
      EXPECT_GE(w, 0);
      mean += w / static_cast<double>(load.size());
    }
    for (const double w : load) absolute += std::fabs(w - mean) / static_cast<double>(load.size());
    EXPECT_NEAR(mean, 1, 1e-9);
    EXPECT_GT(absolute, 0.1) << name_of(static_cast<OutsideLoad>(k));
  }
  virtual_robot::Rng rng(0);
  const auto heater = outside_load_w(OutsideLoad::falling_heater, instants_, rng);
  ASSERT_FALSE(heater.empty());
  EXPECT_NEAR(heater.front() / heater.back(), 4, 0.4);
}

TEST(Resampled, GivesBlocksOfTheSource) {
  std::vector<std::vector<double>> source(3);
  double value = 0;
  for (const std::size_t n : {400u, 0u, 30u}) {
    auto& of_mission = source[n == 400 ? 0 : n == 0 ? 1 : 2];
    for (std::size_t k = 0; k < n; ++k) of_mission.push_back(++value);
    value += 1000;
  }
  virtual_robot::Rng rng(3);
  const auto made = resampled(source, 0.5, rng);
  ASSERT_EQ(made.size(), 3u);
  EXPECT_EQ(made[0].size(), 400u);
  EXPECT_TRUE(made[1].empty());
  EXPECT_EQ(made[2].size(), 30u);
  // Runs of neighbours are at least 5 s long, except the last and those of a short mission.
  std::size_t run = 1, breaks = 0;
  for (std::size_t k = 1; k < made[0].size(); ++k) {
    if (made[0][k] == made[0][k - 1] + 1) {
      ++run;
      continue;
    }
    EXPECT_GE(run, 10u);
    run = 1;
    ++breaks;
  }
  EXPECT_GT(breaks, 3u);
}

TEST_F(Plant, KeepsRecordingHoldsAndRounding) {
  MotionLog log = log_;
  for (auto& mission : log.missions) {
    double held_a = 0;
    for (std::size_t k = 0; k < mission.samples.size(); ++k) {
      signals::Sample& s = mission.samples[k];
      if (k % 10 == 0) held_a = 0.25 * std::round(s.battery_current_a / 0.25) + (k % 20 == 0 ? 0.25 : 0);
      s.battery_current_a = k < 20 ? signals::unmeasured : held_a;
      s.battery_voltage_v = 48 - 0.1 * held_a;
      s.motor_current_a = {1, 1};
    }
  }
  log = motion_log_of(log.missions);
  ASSERT_NEAR(log.battery.period_s, 1, 1e-9);
  ASSERT_NEAR(log.battery.resistance_ohm, 0.1, 1e-3);
  std::vector<std::vector<MeteredPower>> power;
  for (const auto& instants : log.instants) {
    auto& of_mission = power.emplace_back();
    for (const Instant& at : instants) of_mission.push_back({at.power_w() + 50, at.power_w() + 80});
  }
  const auto made = made_recording(log, power);
  for (std::size_t m = 0; m < made.size(); ++m) {
    EXPECT_TRUE(std::isnan(made[m].samples[0].battery_current_a));
    EXPECT_TRUE(std::isnan(made[m].samples[50].motor_current_a[0]));
    for (std::size_t n = 0; n < log.instants[m].size(); ++n) {
      const Instant& at = log.instants[m][n];
      const signals::Sample& s = made[m].samples[at.sample];
      EXPECT_NEAR(s.battery_voltage_v * s.battery_current_a, power[m][n].read_w, 48 * 0.125 + 1);
      EXPECT_NEAR(std::remainder(s.battery_current_a, 0.25), 0, 1e-6);
      // About 50 W more at 48 V; errors of readings cause no sag.
      EXPECT_NEAR(at.voltage_v - s.battery_voltage_v, 0.1 * 50 / 48, 0.03);
      for (std::size_t k = at.sample; k < at.sample + 10 && k < made[m].samples.size(); ++k)
        EXPECT_EQ(made[m].samples[k].battery_current_a, s.battery_current_a);
    }
    EXPECT_EQ(made[m].samples[77].wheel_velocity_rad_s, log.missions[m].samples[77].wheel_velocity_rad_s);
  }
}

}  // namespace
}  // namespace joulecast::trial::motion
