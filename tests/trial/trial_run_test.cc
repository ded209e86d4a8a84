#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/study/trial/run.h"
#include "tests/study/trial/score.h"
#include "tests/study/trial/score_text.h"

namespace joulecast::trial {
namespace {

RunSettings trial_of(std::size_t count, std::uint64_t seed) {
  RunSettings settings;
  settings.trial.count = count;
  settings.trial.seed = seed;
  settings.trial.vary_plant = false;
  settings.trial.channels = ChannelChoice::full;
  return settings;
}

std::string cases_of(const std::vector<CaseOutcome>& outcomes) {
  nlohmann::json cases = nlohmann::json::array();
  for (const CaseOutcome& outcome : outcomes) cases.push_back(case_json(outcome));
  return cases.dump();
}

TEST(Trial, KeepsResultsForThreadCounts) {
  RunSettings settings = trial_of(3, 901);
  const auto alone = run_trial(settings);
  settings.jobs = 2;
  const auto together = run_trial(settings);
  ASSERT_TRUE(alone && together);
  EXPECT_EQ(cases_of(*alone), cases_of(*together));  // including digests of robot file, log and truth
}

TEST(Trial, LogsOmitTruth) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "joulecast-trial-kept";
  std::filesystem::remove_all(folder);
  RunSettings settings = trial_of(1, 902);
  settings.trial.only_effect = "accessory_load";
  settings.keep = folder;
  const auto outcomes = run_trial(settings);
  ASSERT_TRUE(outcomes) << describe(outcomes.error());
  const CaseFiles files{folder / "case-0000"};
  const auto truth = open_truth(files.truth());
  ASSERT_TRUE(truth);
  ASSERT_EQ(truth->effects.size(), 1u);
  EXPECT_EQ(truth->effects[0].id, "accessory_load");
  for (const auto& path : {files.log(), files.robot()}) {
    std::ifstream in(path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    EXPECT_GT(bytes.size(), 500u);
    EXPECT_EQ(bytes.find("accessory"), std::string::npos) << path;
  }
  EXPECT_TRUE(nlohmann::json::parse(std::ifstream(files.robot()))["effects"].is_null());
  std::filesystem::remove_all(folder);
}

TEST(Trial, OracleRemovesMostOfGap) {
  RunSettings settings = trial_of(1, 903);
  settings.trial.only_effect = "coulomb_friction";
  const auto outcomes = run_trial(settings);
  ASSERT_TRUE(outcomes);
  ASSERT_TRUE(outcomes->front().oracle);
  EXPECT_GT(*outcomes->front().oracle, 0.3);
  EXPECT_LT(*outcomes->front().oracle, 1);
}

// The bounds are one or two cases of each kind below the present results (18 of 20 cases; 8 and 7 of 9
// singles named first and exactly; all pairs, clear robots and unknown effects), and far above the results
// with a part broken: without the nuisance model, an effect is named in every case without a gap.
TEST(Trial, StaysAboveBounds) {
  const auto outcomes = run_trial(trial_of(20, 7));
  ASSERT_TRUE(outcomes);
  Rate single, first, pair, none, outside, all;
  for (const CaseOutcome& o : *outcomes) {
    switch (o.truth.kind) {
      case Kind::none:
        none.count(exactly_right(o));
        break;
      case Kind::single:
        single.count(exactly_right(o));
        first.count(first_right(o));
        break;
      case Kind::pair:
        pair.count(exactly_right(o));
        break;
      case Kind::outside:
        outside.count(exactly_right(o));
        break;
    }
    all.count(exactly_right(o));
    if (!exactly_right(o)) std::puts(case_text(o).c_str());
  }
  EXPECT_GE(none.value(), 0.6);
  EXPECT_GE(first.value(), 0.65);
  EXPECT_GE(single.value(), 0.65);
  EXPECT_GE(pair.value(), 0.6);
  EXPECT_GE(outside.value(), 0.3);  // the target is 0.8
  EXPECT_GE(all.value(), 0.8);
  EXPECT_EQ(score_of(*outcomes).outside_misled.hits, 0u);
}

}  // namespace
}  // namespace joulecast::trial
