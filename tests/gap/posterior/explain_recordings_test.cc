#include "gap/posterior/explain_recordings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "gap/posterior/constancy.h"
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
