#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "gap/diagnose/recordings.h"
#include "gap/verdict/text.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::gap {
namespace {

namespace vr = virtual_robot;
using signals::unmeasured;

// Missions of the project's own plant, which shares no physics with the model.
made::Robot virtual_missions(const std::vector<vr::EffectStrength>& effects, std::uint64_t seed, bool motors,
                             int missions) {
  return made::virtual_robot(vr::shipped_robots()[1].kind, seed, [&](vr::SimulationSpec& spec) {
    const vr::SimulationSpec usual;
    spec.script = usual.script;
    spec.rate_hz = usual.rate_hz;
    spec.imperfections = *vr::make_imperfections(effects);
    spec.missions = missions;
    spec.sensors.motor_channels = motors;
  });
}

Diagnosis diagnose_robot(const made::Robot& robot) {
  return *diagnose(robot.recordings, robot.model);
}

Diagnosis diagnose_virtual(const std::vector<vr::EffectStrength>& effects, std::uint64_t seed, bool motors,
                           int missions = 5) {
  return diagnose_robot(virtual_missions(effects, seed, motors, missions));
}

TEST(VirtualRobot, ReturnsNoneWithoutImperfections) {
  for (const bool motors : {true, false}) {
    const Diagnosis d = diagnose_virtual({}, 11, motors);
    EXPECT_EQ(name_of(d.verdict), "none");
    EXPECT_TRUE(d.effects.empty());
    EXPECT_TRUE(d.adoptable.empty());
  }
}

// At 6 Hz the motors' torques contain an error of the model, whose explanation predicts power worse than the
// file.
TEST(VirtualRobot, SlowReadingsAreNone) {
  for (const std::uint64_t seed : {1u, 2u}) {
    const Diagnosis d = diagnose_robot(made::virtual_robot("amr", seed, [](vr::SimulationSpec& spec) {
      spec.script = vr::SimulationSpec{}.script;
      spec.rate_hz = 6;
      spec.missions = 6;
    }));
    EXPECT_EQ(name_of(d.verdict), "none");
  }
}

TEST(VirtualRobot, NamesEffectFromOneMission) {
  const Diagnosis d = diagnose_virtual({{"coulomb_friction", 0.6}}, 12, true, 1);
  ASSERT_EQ(d.effects.size(), 1u);
  EXPECT_EQ(d.effects[0].id, "coulomb_friction");
  EXPECT_EQ(d.missions, 1u);
  ASSERT_TRUE(d.shrinkage);
  EXPECT_GT(d.shrinkage->fraction, 0.5);
}

TEST(VirtualRobot, DerivesPowerFromMotorCurrents) {
  made::Robot robot = virtual_missions({{"coulomb_friction", 0.6}}, 12, true, 3);
  for (telemetry::Recording& mission : robot.recordings.missions) {
    for (auto& s : mission.samples) {
      s.motor_voltage_v = {unmeasured, unmeasured};
      s.battery_voltage_v = s.battery_current_a = unmeasured;
    }
  }
  const Diagnosis d = diagnose_robot(robot);
  EXPECT_EQ(d.power, PowerSource::motors);
  ASSERT_FALSE(d.where.empty());
  EXPECT_EQ(d.where[0].channel, "motor_power");
  ASSERT_EQ(d.effects.size(), 1u);
  EXPECT_EQ(d.effects[0].id, "coulomb_friction");
  ASSERT_TRUE(d.shrinkage);
  EXPECT_GT(d.shrinkage->fraction, 0.5);
  EXPECT_EQ(d.notes.size(), 1u);
}

// Without battery power the base load of the file is not compared with anything.
TEST(VirtualRobot, IdlePowerIsNoMeasurement) {
  made::Robot robot = virtual_missions({{"coulomb_friction", 0.6}}, 12, true, 3);
  for (telemetry::Recording& mission : robot.recordings.missions)
    for (auto& s : mission.samples) s.battery_voltage_v = s.battery_current_a = unmeasured;
  robot.model.idle_power_w = 0;
  const Diagnosis none = diagnose_robot(robot);
  robot.model.idle_power_w = 200;
  const Diagnosis high = diagnose_robot(robot);
  EXPECT_GT(none.power_absolute_relative, 0.1);
  EXPECT_NEAR(high.power_absolute_relative, none.power_absolute_relative, 1e-9);
  EXPECT_NEAR(high.energy_relative, none.energy_relative, 1e-9);
  EXPECT_NEAR(high.noise_floor, none.noise_floor, 1e-6);
  for (const Diagnosis* d : {&none, &high}) {
    EXPECT_EQ(name_of(d->verdict), name_of(none.verdict));
    ASSERT_EQ(d->effects.size(), 1u);
    EXPECT_EQ(d->effects[0].id, "coulomb_friction");
  }
}

// Battery power only, of a robot with three times the friction of its file and a computer that is absent from
// the file.
TEST(VirtualRobot, RecalibratesMismatchedFile) {
  const made::Robot robot = virtual_missions({{"coulomb_friction", 2}, {"accessory_load", 25}}, 18, false, 5);
  const Diagnosis d = diagnose_robot(robot);
  EXPECT_EQ(name_of(d.verdict), "not_this_robot");
  for (const DiagnosedEffect& e : d.effects) EXPECT_TRUE(e.probability >= 0 && e.probability <= 1) << e.id;
  // The load is certain as a sum of effects of its form.
  const auto load = std::ranges::find_if(d.sums, [](const TermSum& sum) {
    return std::ranges::find(sum.effects, "accessory_load") != sum.effects.end();
  });
  ASSERT_NE(load, d.sums.end());
  EXPECT_NEAR(load->difference_w, 25, 4);
  EXPECT_FALSE(d.corrections.empty());
  ASSERT_TRUE(d.baseline);
  EXPECT_LT(d.baseline->explanation_held_out, 0.2 * d.baseline->unchanged_model_held_out);
}

// Without the loaded mission the effect of a load is undetermined. Its halves are held out in turn.
TEST(VirtualRobot, NamesEffectOfLoadedMission) {
  made::Robot robot = virtual_missions({{"load_rolling_resistance", 0.15}}, 17, true, 12);
  auto& recordings = robot.recordings.missions;
  bool loaded = false;
  std::erase_if(recordings, [&](const telemetry::Recording& mission) {
    const bool first_load = mission.payload_kg > 0 && !loaded;
    loaded = loaded || first_load;
    return mission.payload_kg > 0 && !first_load;
  });
  ASSERT_GE(recordings.size(), 2u);
  ASSERT_TRUE(loaded);
  const Diagnosis d = diagnose_robot(robot);
  EXPECT_EQ(name_of(d.verdict), "effects");
  ASSERT_EQ(d.effects.size(), 1u);
  EXPECT_EQ(d.effects[0].id, "load_rolling_resistance");
  EXPECT_GT(d.shrinkage->fraction, 0.5);
}

TEST(VirtualRobot, ReportsUnknownLoadAsOutside) {
  const Diagnosis d = diagnose_virtual({{"x_heading_load", 12}}, 13, true);
  EXPECT_EQ(name_of(d.verdict), "outside");
  EXPECT_EQ(d.outside.follows, "heading");
  // The mean is named as a constant load with a low probability at most.
  for (const DiagnosedEffect& effect : d.effects) EXPECT_LT(effect.probability, 0.9) << effect.id;
}

TEST(VirtualRobot, NamesDissipativeSlip) {
  const Diagnosis d = diagnose_virtual({{"wheel_slip", 0.1}}, 14, true);
  ASSERT_EQ(d.effects.size(), 1u);
  // A smaller wheel differs from slip by its lever only.
  const auto& others = d.effects[0].alternatives;
  EXPECT_TRUE(d.effects[0].id == "wheel_slip" || std::ranges::find(others, "wheel_slip") != others.end())
      << d.effects[0].id;
  EXPECT_NEAR(std::fabs(d.effects[0].parameters[0].value), 0.1, 0.01);
}

// Little of the power is lost in the windings, but the motors' voltages show it.
TEST(VirtualRobot, NamesResistanceByVoltage) {
  const Diagnosis d = diagnose_virtual({{"resistance_error", 0.5}}, 15, true);
  ASSERT_EQ(d.effects.size(), 1u);
  EXPECT_EQ(d.effects[0].id, "resistance_error");
  EXPECT_NEAR(d.effects[0].parameters[0].value, 0.5, 0.05);
}

TEST(VirtualRobot, SeparatesBrushDropFromResistance) {
  const Diagnosis d = diagnose_virtual({{"brush_drop", 1.2}}, 15, true);
  ASSERT_EQ(d.effects.size(), 1u);
  EXPECT_EQ(d.effects[0].id, "brush_drop");
  EXPECT_NEAR(d.effects[0].parameters[0].value, 1.2, 0.12);
}

TEST(VirtualRobot, RejectsSensorErrorUnderSag) {
  const Diagnosis d = diagnose_virtual({{"x_sag_load", 8}}, 16, true);
  // A constant load explains most of it; a gain error of the battery's sensor has a similar form.
  EXPECT_FALSE(d.verdict == Verdict::none || d.verdict == Verdict::not_this_robot) << name_of(d.verdict);
  for (const DiagnosedEffect& effect : d.effects) {
    if (effect.id == "accessory_load") continue;
    EXPECT_LT(effect.probability, 0.9) << effect.id;
  }
}

TEST(VirtualRobot, ReportsCoggingAsOutside) {
  for (const bool motors : {true, false}) {
    const Diagnosis d = diagnose_virtual({{"x_cogging", 0.8}}, 17, motors);
    EXPECT_EQ(name_of(d.verdict), "outside");
    EXPECT_EQ(d.outside.follows, "wheel_angle");
    for (const DiagnosedEffect& effect : d.effects) EXPECT_LT(effect.probability, 0.9) << effect.id;
  }
}

TEST(VirtualRobot, SeparatesDelayFromRipple) {
  // Delayed currents leave residuals at each start and stop, independent of the wheel angle.
  const Diagnosis d = diagnose_virtual({{"sensor_delay", 0.13}}, 18, true);
  EXPECT_EQ(name_of(d.verdict), "effects");
  EXPECT_NEAR(d.effects.at(0).parameters[0].value, 0.13, 0.01);
}

TEST(VirtualRobot, RejectsFrictionForBrakeDrag) {
  const Diagnosis d = diagnose_virtual({{"x_brake_drag", 1}}, 19, true);
  EXPECT_TRUE(d.verdict == Verdict::outside || d.verdict == Verdict::inconclusive)
      << name_of(d.verdict) << ", gap " << d.power_absolute_relative << " over noise " << d.noise_floor
      << ", outside " << d.outside.probability << " " << d.outside.follows << ", detectable "
      << d.detectable_share;
  for (const DiagnosedEffect& effect : d.effects) EXPECT_LT(effect.probability, 0.9) << effect.id;
}

TEST(VirtualRobot, NamesLargeDriverLoss) {
  const Diagnosis d = diagnose_virtual({{"driver_loss", 0.42}}, 20, true);
  ASSERT_EQ(d.effects.size(), 1u);
  EXPECT_EQ(d.effects[0].id, "driver_loss");
  EXPECT_NEAR(d.effects[0].parameters[0].value, 0.42, 0.042);
}

// Battery power is correct in this case, and there is no gap.
TEST(VirtualRobot, NamesMotorSensorErrors) {
  struct Wrong {
    const char* id;
    double current_gain, current_bias_a, voltage_gain, value;
  };
  for (const Wrong& w :
       {Wrong{"current_sensor_gain", 1.15, 0, 1, 0.15}, Wrong{"current_sensor_gain", 0.9, 0, 1, -0.1},
        Wrong{"current_sensor_bias", 1, 0.5, 1, 0.5}, Wrong{"voltage_sensor_gain", 1, 0, 1.1, 0.1}}) {
    made::Robot robot = virtual_missions({}, 17, true, 5);
    for (telemetry::Recording& mission : robot.recordings.missions) {
      for (auto& s : mission.samples) {
        for (double& i : s.motor_current_a) i = w.current_gain * i + w.current_bias_a;
        for (double& v : s.motor_voltage_v) v *= w.voltage_gain;
      }
    }
    const Diagnosis d = diagnose_robot(robot);
    SCOPED_TRACE(w.id);
    EXPECT_EQ(name_of(d.verdict), "effects");
    ASSERT_EQ(d.effects.size(), 1u);
    EXPECT_EQ(d.effects[0].id, w.id);
    EXPECT_GE(d.effects[0].probability, 0.9);
    EXPECT_NEAR(d.effects[0].parameters[0].value, w.value, 0.17 * std::fabs(w.value));
    EXPECT_LT(d.power_absolute_relative, 0.03);
  }
}

// The delay exceeds the linear range. It is removed as measured by the checks and hides no other effect.
TEST(VirtualRobot, NamesHalfSecondBatteryDelay) {
  for (const double gain : {1.0, 1.2}) {
    made::Robot robot = virtual_missions({{"coulomb_friction", gain - 1}}, 18, false, 5);
    for (telemetry::Recording& mission : robot.recordings.missions) {
      const std::vector<signals::Sample> on_time = mission.samples;
      const auto late = static_cast<std::size_t>(
          std::lround(0.5e6 / static_cast<double>(on_time[1].utime_us - on_time[0].utime_us)));
      for (std::size_t k = 0; k < on_time.size(); ++k) {
        const signals::Sample& before = on_time[k < late ? 0 : k - late];
        mission.samples[k].battery_current_a = before.battery_current_a;
        mission.samples[k].battery_voltage_v = before.battery_voltage_v;
      }
    }
    const Diagnosis d = diagnose_robot(robot);
    EXPECT_EQ(name_of(d.verdict), "effects");
    const auto delay = std::ranges::find(d.effects, "sensor_delay", &DiagnosedEffect::id);
    ASSERT_NE(delay, d.effects.end());
    EXPECT_NEAR(delay->parameters[0].value, 0.5, 0.02);
    EXPECT_EQ(d.effects.size(), gain > 1 ? 2u : 1u);
    ASSERT_TRUE(d.shrinkage);
    // The file has a smaller error in rows of half a second than in shorter ones; the rest is noise.
    EXPECT_GT(d.shrinkage->fraction, 0.65);
    EXPECT_LT(d.shrinkage->remaining_over_noise_floor, 1.5);
  }
}

// The load is the only departure from the file.
TEST(VirtualRobot, ReportsFallingLoadInWatts) {
  made::Robot robot = virtual_missions({}, 19, false, 6);
  const double first_w = 40;
  for (telemetry::Recording& mission : robot.recordings.missions) {
    const double length_us =
        static_cast<double>(mission.samples.back().utime_us - mission.samples.front().utime_us);
    for (auto& s : mission.samples) {
      const double part = static_cast<double>(s.utime_us - mission.samples.front().utime_us) / length_us;
      s.battery_current_a += first_w * (1 - part) / s.battery_voltage_v;
    }
  }
  const Diagnosis d = diagnose_robot(robot);
  EXPECT_EQ(d.outside.follows, "time");
  EXPECT_EQ(d.outside.like, "accessory_load");
  EXPECT_NEAR(d.outside.power_w[0], first_w * 5 / 6, 0.15 * first_w);
  EXPECT_NEAR(d.outside.power_w[1], first_w / 6, 0.15 * first_w);
  EXPECT_NE(outside_words(d.outside).find("load independent of motion (probability "), std::string::npos);
  EXPECT_NE(outside_words(d.outside).find(" follows time or place: from "), std::string::npos);
}

// Noise of 25 W that changes every second. These recordings do not rule out a gap.
TEST(VirtualRobot, PureNoiseIsInconclusive) {
  made::Robot robot = virtual_missions({}, 20, false, 6);
  std::mt19937_64 engine(20);
  std::normal_distribution<double> normal(0, 25);
  for (telemetry::Recording& mission : robot.recordings.missions) {
    double more_w = 0;
    for (std::size_t k = 0; k < mission.samples.size(); ++k) {
      if (k % 50 == 0) more_w = normal(engine);
      const double more_a = more_w / mission.samples[k].battery_voltage_v;
      mission.samples[k].battery_current_a += more_a;
      mission.samples[k].battery_voltage_v -= robot.model.battery.internal_resistance_ohm * more_a;
    }
  }
  const Diagnosis d = diagnose_robot(robot);
  EXPECT_GT(d.noise_floor, 0.2);
  EXPECT_EQ(name_of(d.verdict), "inconclusive");
}

TEST(VirtualRobot, ExcludesMissionWithDeadWheels) {
  made::Robot robot = virtual_missions({{"coulomb_friction", 0.6}}, 21, false, 5);
  for (auto& s : robot.recordings.missions[2].samples) s.wheel_velocity_rad_s = {0, 0};
  const Diagnosis d = diagnose_robot(robot);
  ASSERT_FALSE(d.checks.empty());
  EXPECT_EQ(d.checks[0].few_missions, std::vector<std::size_t>{2});
  ASSERT_FALSE(d.effects.empty());
  // Friction of both sides and twice the friction of one give nearly the same battery power.
  const auto& others = d.effects[0].alternatives;
  EXPECT_TRUE(d.effects[0].id == "coulomb_friction" ||
              std::ranges::find(others, "coulomb_friction") != others.end())
      << d.effects[0].id;
  EXPECT_TRUE(std::isfinite(d.noise_floor));
  ASSERT_TRUE(d.baseline);
  EXPECT_TRUE(std::isfinite(d.baseline->held_out));
}

}  // namespace
}  // namespace joulecast::gap
