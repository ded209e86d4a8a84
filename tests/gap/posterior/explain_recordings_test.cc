#include "gap/posterior/explain_recordings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "gap/verdict/answer.h"
#include "robot/robot_file.h"
#include "tests/gap/posterior/made_robot.h"

namespace joulecast::gap::posterior {
namespace {

using made::Drives;

const ExplainedBy* find(const Explained& a, std::string_view id) {
  const auto at = std::ranges::find(a.effects, id, &ExplainedBy::id);
  return at == a.effects.end() ? nullptr : &*at;
}

TEST(ExplainRecordings, ReturnsNoneForPureNoise) {
  const Drives drives(1);
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  EXPECT_EQ(a->verdict, Verdict::none);
  EXPECT_FALSE(a->adopts);
  // On held-out data, the explanation of noise predicts as well as the file.
  EXPECT_NEAR(a->held_out.explanation, a->held_out.file, 0.002);
}

TEST(ExplainRecordings, NamesConstantLoad) {
  Drives drives(2);
  drives.load_w = [](double) { return 6.0; };
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  const ExplainedBy* load = find(*a, "accessory_load");
  ASSERT_NE(load, nullptr);
  EXPECT_EQ(a->verdict, Verdict::effects);
  // At a steady voltage a current bias is equivalent.
  EXPECT_GT(load->group, 0.9);
  EXPECT_GT(load->constant, 0.9);
  EXPECT_NEAR(load->parameters.front().value, 6, 3 * load->parameters.front().deviation + 0.3);
  EXPECT_LT(a->held_out.explanation, 0.6 * a->held_out.file);
  EXPECT_TRUE(a->adopts);
}

// The file that is adopted has no heater: its base load contains the heater's mean.
TEST(ExplainRecordings, AdoptsCovariateAtItsMean) {
  constexpr double heater_w = 30;
  const auto heats = [](double t) { return std::fmod(t, 16) < 4; };
  Drives drives(9);
  drives.load_w = [&](double t) { return heats(t) ? heater_w : 0.0; };
  telemetry::RecordingSet recordings = drives.recordings();
  for (std::size_t m = 0; m < recordings.missions.size(); ++m) {
    telemetry::Recording& mission = recordings.missions[m];
    signals::CovariateSeries& series = mission.covariates.emplace_back("heater");
    for (std::size_t k = 0; k < mission.samples.size(); ++k) {
      series.utime_us.push_back(mission.samples[k].utime_us);
      series.value.push_back(heats(80.0 * static_cast<double>(m) + 0.05 * static_cast<double>(k)) ? 1 : 0);
    }
  }
  const auto a = explain_recordings(recordings, drives.robot);
  ASSERT_TRUE(a);
  const ExplainedBy* heater = find(*a, "covariate:heater");
  ASSERT_NE(heater, nullptr);
  EXPECT_NEAR(heater->parameters.front().value, heater_w, 1);
  EXPECT_TRUE(a->adopts);
  const auto load = std::ranges::find(a->model, "accessory_load",
                                      [](const dynamics::ActiveEffect& e) { return e.effect->info().id; });
  ASSERT_NE(load, a->model.end());
  EXPECT_NEAR(load->values[0], heater_w / 4, 1);  // on for 4 of 16 s
}

// The same power over a battery of this resistance, with voltages read to 0.1 V.
telemetry::RecordingSet over_resistance(const Drives& drives, double resistance_ohm) {
  telemetry::RecordingSet recordings = drives.recordings();
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 0.1);
  for (telemetry::Recording& mission : recordings.missions) {
    for (signals::Sample& s : mission.samples) {
      const double open_v = 25.5, power_w = s.battery_voltage_v * s.battery_current_a;
      s.battery_voltage_v =
          0.5 * (open_v + std::sqrt(open_v * open_v - 4 * resistance_ohm * power_w)) + noise(random);
      s.battery_current_a = power_w / s.battery_voltage_v;
    }
  }
  return recordings;
}

// The answer of the battery's voltage alone, given how well the robot matches its file.
Explained by_terminals(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                       const Eigen::Vector4d& factors) {
  const Data data = *make_data(recordings.missions, robot);
  return explain(*walk(rows_of_witness(data, Witness::terminals, factors)));
}

TEST(RowsOfWitness, ShowBatteryResistanceByVoltage) {
  const Drives drives(8);
  const double file_ohm = drives.robot.battery.internal_resistance_ohm;
  const telemetry::RecordingSet weak = over_resistance(drives, 2.5 * file_ohm);
  const Explained matching = by_terminals(weak, drives.robot, {1, 0, 0, 0});
  const ExplainedBy* found = find(matching, "battery_resistance");
  ASSERT_NE(found, nullptr);
  EXPECT_GT(found->group, 0.9);
  EXPECT_NEAR(found->parameters.front().value, 1.5, 0.2);
  // In a guessed file any resistance is the file's.
  const Explained guessed = by_terminals(weak, drives.robot, {0, 0, 0, 1});
  const ExplainedBy* in_guessed = find(guessed, "battery_resistance");
  EXPECT_TRUE(in_guessed == nullptr || in_guessed->group < named);
  const Explained sound = by_terminals(over_resistance(drives, file_ohm), drives.robot, {1, 0, 0, 0});
  EXPECT_EQ(find(sound, "battery_resistance"), nullptr);
}

// A load, and a battery of a fifth more resistance than the file's: its voltage given its current falls as if
// the current's sensor read too little.
TEST(ExplainRecordings, ResistanceIsNoSensorGain) {
  Drives drives(10);
  drives.load_w = [](double) { return 40.0; };
  const auto a = explain_recordings(
      over_resistance(drives, 1.2 * drives.robot.battery.internal_resistance_ohm), drives.robot);
  ASSERT_TRUE(a);
  const ExplainedBy* load = find(*a, "accessory_load");
  ASSERT_NE(load, nullptr);
  EXPECT_GT(load->group, 0.9);
  EXPECT_NEAR(load->parameters.front().value, 40, 2);
  const ExplainedBy* gain = find(*a, "current_sensor_gain");
  EXPECT_TRUE(gain == nullptr || gain->group < named);
}

TEST(ReportedEffects, OmitsPartsOfOneResample) {
  Explained a;
  for (const double group : {0.7, 0.2, 0.05}) {
    a.effects.emplace_back().id = "accessory_load";
    a.effects.back().probability = a.effects.back().group = group;
  }
  const auto reported = [&](Verdict verdict) {
    a.verdict = verdict;
    Diagnosis d;
    state_effects(a, 100, d);
    return d.effects.size();
  };
  EXPECT_EQ(reported(Verdict::none), 0U);
  EXPECT_EQ(reported(Verdict::effects), 1U);
  EXPECT_EQ(reported(Verdict::inconclusive), 2U);
  EXPECT_EQ(reported(Verdict::not_this_robot), 2U);
}

TEST(ExplainRecordings, NeverNoneWhereLoadSwitches) {
  Drives drives(9);
  drives.load_w = [](double t) { return std::fmod(t, 40) < 10 ? 25.0 : 0.0; };
  const auto a = explain_recordings(drives.recordings(), drives.robot);
  ASSERT_TRUE(a);
  EXPECT_GT(a->repeats_file, 0.04);
  EXPECT_NE(a->verdict, Verdict::none);
}

TEST(RemovedInterval, ContainsZeroForScatter) {
  using Block = HeldOut::Block;
  std::vector<Block> steady(10), scattered(10);
  for (std::size_t k = 0; k < 10; ++k) {
    steady[k] = {.file = 100, .explanation = 99, .size = 1000};
    scattered[k] = {.file = 100, .explanation = k % 2 == 0 ? 120.0 : 79.0, .size = 1000};
  }
  EXPECT_NEAR(removed_interval(steady)[0], 0.01, 1e-12);
  EXPECT_NEAR(removed_interval(steady)[1], 0.01, 1e-12);
  EXPECT_LT(removed_interval(scattered)[0], 0);
  EXPECT_GT(removed_interval(scattered)[1], 0);
  EXPECT_TRUE(std::isnan(removed_interval(std::span(steady).first(1))[0]));
}

// Of four resamples of two blocks, one has only the block that the explanation predicts worse.
TEST(ChanceOfBenefit, IsPartOfResamples) {
  using Block = HeldOut::Block;
  const std::vector<Block> two{{.file = 2, .explanation = 1, .size = 10},
                               {.file = 1, .explanation = 1.5, .size = 10}};
  EXPECT_NEAR(chance_of_benefit(two), 0.75, 0.07);
  EXPECT_EQ(chance_of_benefit(std::span(two).first(1)), 1);
}

TEST(Constancy, RejectsSwitchedLoad) {
  Drives steady(4), switching(4);
  steady.load_w = [](double) { return 6.0; };
  switching.load_w = [](double t) { return std::fmod(t, 64) < 32 ? 12.0 : 0.0; };
  const auto constant_of = [](const Drives& drives) {
    const telemetry::RecordingSet recordings = drives.recordings();
    const std::unique_ptr<Fit> fit = walk(*make_data(recordings.missions, drives.robot));
    for (std::size_t h = 0; h < fit->prior->size(); ++h) {
      if (fit->catalogue.hypotheses[h].id() == "accessory_load")
        return constancy(*fit, std::array{h}, 0).probability;
    }
    return missing;
  };
  EXPECT_GT(constant_of(steady), 0.9);
  EXPECT_LT(constant_of(switching), named);
}

TEST(RepeatedPart, ReturnsPartSharedByNeighbours) {
  const Drives drives(5);
  const telemetry::RecordingSet recordings = drives.recordings();
  const Data data = *make_data(recordings.missions, drives.robot);
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0, 1);
  Eigen::VectorXd white(ix(data.rows.size()));
  for (double& v : white) v = noise(random);
  EXPECT_LT(repeated_part(data, white) * data.mean_power_w, 0.3);
  const Eigen::VectorXd offset = white.array() + 2;
  EXPECT_NEAR(repeated_part(data, offset) * data.mean_power_w, 2, 0.1);
}

TEST(Linearise, OmitsConstantVoltage) {
  const Drives drives(7);
  const telemetry::RecordingSet recordings = drives.recordings();
  const std::unique_ptr<Fit> fit = walk(*make_data(recordings.missions, drives.robot));
  const auto of = [&](Channel c) {
    return std::ranges::count(fit->equations.channels, c, &ChannelRows::channel);
  };
  EXPECT_EQ(of(Channel::battery_voltage), 0);
  EXPECT_EQ(of(Channel::power), 1);
}

TEST(MakeData, RejectsTooFewRows) {
  const Drives drives(6);
  telemetry::RecordingSet recordings = drives.recordings();
  recordings.missions.resize(1);
  recordings.missions[0].samples.resize(30);
  EXPECT_FALSE(make_data(recordings.missions, drives.robot));
}

}  // namespace
}  // namespace joulecast::gap::posterior
