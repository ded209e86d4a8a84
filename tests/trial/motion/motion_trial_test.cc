#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/study/trial/motion/motion_run.h"
#include "tests/study/trial/motion/motion_score.h"
#include "tests/study/trial/motion/motion_text.h"
#include "tests/trial/motion/driven_log.h"

namespace joulecast::trial::motion {
namespace {

class MotionTrial : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = std::filesystem::temp_directory_path() / ("joulecast-motion-trial-" + std::to_string(getpid()));
    write_driven_folder(folder / "logs");
    std::vector<std::string> skipped;
    auto read = read_base_logs(folder / "logs", skipped);
    ASSERT_TRUE(read) << describe(read.error());
    logs = std::move(*read);
    EXPECT_TRUE(skipped.empty());
  }
  static void TearDownTestSuite() {
    std::filesystem::remove_all(folder);
    logs.clear();
  }

  static std::string cases_of(const std::vector<MotionOutcome>& outcomes) {
    nlohmann::json cases = nlohmann::json::array();
    for (const MotionOutcome& o : outcomes) cases.push_back(motion_case_json(o));
    return cases.dump();
  }

  static inline std::filesystem::path folder;
  static inline std::vector<BaseLog> logs;
};

TEST_F(MotionTrial, ReadsLogsWithBasePower) {
  ASSERT_EQ(logs.size(), 1u);
  EXPECT_TRUE(logs[0].log.own_kinematics);
  EXPECT_LT(logs[0].mismatch, 0.005);
  EXPECT_NEAR(logs[0].fit.base[3], 100, 10);
  std::vector<std::string> skipped;
  EXPECT_FALSE(read_base_logs(folder / "nowhere", skipped));
}

TEST_F(MotionTrial, DrawsDependOnCase) {
  MotionSettings settings;
  settings.seed = 12;
  std::map<Kind, std::size_t> kinds;
  std::size_t own = 0, effects = 0;
  for (std::size_t k = 0; k < 200; ++k) {
    settings.count = k + 1;
    const MotionCase c = draw_motion_case(settings, logs, k);
    ++kinds[c.truth.kind];
    EXPECT_EQ(c.truth.gap_class == 0, c.truth.kind == Kind::none);
    if (c.truth.kind == Kind::outside || c.truth.kind == Kind::none) continue;
    ASSERT_EQ(c.truth.effects.size(), c.truth.kind == Kind::pair ? 2u : 1u);
    for (const TrueEffect& e : c.truth.effects) {
      EXPECT_EQ(e.gap, c.truth.gap_class);
      own += e.catalogue ? 0 : 1;
      ++effects;
    }
  }
  EXPECT_EQ(kinds[Kind::none], 40u);
  EXPECT_GE(kinds[Kind::single], 90u);
  EXPECT_GE(kinds[Kind::pair], 35u);
  EXPECT_GE(kinds[Kind::outside], 25u);
  EXPECT_NEAR(static_cast<double>(own) / static_cast<double>(effects), 1.0 / 3, 0.1);
  settings.count = 1;
  const MotionCase alone = draw_motion_case(settings, logs, 17);
  settings.count = 500;
  const MotionCase among = draw_motion_case(settings, logs, 17);
  EXPECT_EQ(alone.noise_seed, among.noise_seed);
  EXPECT_EQ(alone.truth.gap_class, among.truth.gap_class);
}

TEST_F(MotionTrial, RepeatsForAnyJobs) {
  MotionRunSettings settings;
  settings.trial.seed = 13;
  settings.trial.count = 2;
  settings.keep = folder / "kept";
  const auto alone = run_motion_trial(settings, logs);
  ASSERT_TRUE(alone) << describe(alone.error());
  MotionRunSettings others = settings;
  others.keep.clear();
  others.jobs = 2;
  const auto together = run_motion_trial(others, logs);
  settings.again = true;
  const auto again = run_motion_trial(settings, {});
  ASSERT_TRUE(together && again);
  EXPECT_EQ(cases_of(*alone), cases_of(*together));
  EXPECT_EQ(cases_of(*alone), cases_of(*again));
  EXPECT_NE((*alone)[0].digest, (*alone)[1].digest);
}

TEST_F(MotionTrial, DetectsLargeLoad) {
  MotionRunSettings settings;
  settings.trial.seed = 14;
  settings.trial.count = 4;
  settings.trial.only_effect = "accessory_load";
  const auto outcomes = run_motion_trial(settings, logs);
  ASSERT_TRUE(outcomes);
  const MotionOutcome& strong = outcomes->at(3);
  ASSERT_EQ(strong.truth.gap_class, 0.20);
  // The constant of the regression absorbs the load; the file has no such term.
  EXPECT_GT(strong.unchanged_error, strong.referee_error + 0.04);
}

MotionOutcome said(Kind kind, double gap, std::vector<std::string> truth, const std::string& verdict,
                   std::vector<NamedEffect> effects) {
  MotionOutcome o;
  o.truth.kind = kind;
  o.truth.gap_class = gap;
  for (const std::string& id : truth) o.truth.effects.push_back({id, "", true, 1, gap, "", 0});
  o.answer.verdict = verdict;
  o.answer.effects = std::move(effects);
  o.referee_error = 0.1;
  o.explanation_error = 0.1;
  return o;
}

TEST(MotionScore, CountsGroupsAndWrongNames) {
  const NamedEffect right{"coulomb_friction", 0.95, {}, 1, 0.1};
  const NamedEffect group{"brush_drop", 0.92, {"coulomb_friction", "slope"}, 1, 0.1};
  const NamedEffect wide{"brush_drop", 0.92, {"coulomb_friction", "slope", "inductance"}, 1, 0.1};
  const NamedEffect doubtful{"slope", 0.3, {}, 1, 0.1};
  std::vector<MotionOutcome> outcomes;
  outcomes.push_back(said(Kind::single, 0.1, {"coulomb_friction"}, "effects", {right}));
  outcomes.push_back(said(Kind::single, 0.1, {"coulomb_friction"}, "effects", {group}));
  outcomes.push_back(said(Kind::single, 0.1, {"coulomb_friction"}, "effects", {wide}));
  outcomes.push_back(said(Kind::single, 0.1, {"slope"}, "inconclusive", {doubtful}));
  outcomes.push_back(said(Kind::none, 0, {}, "inconclusive", {doubtful}));
  outcomes.push_back(said(Kind::none, 0, {}, "effects", {doubtful}));
  outcomes.push_back(said(Kind::outside, 0.1, {"x_bursts"}, "inconclusive", {right}));
  outcomes.back().explanation_error = 0.12;
  const MotionScore score = motion_score_of(outcomes);
  const GapRow& row = score.rows[2];
  EXPECT_EQ(row.first.hits, 1u);
  EXPECT_EQ(row.first_group.hits, 2u);
  EXPECT_EQ(row.listed_first.hits, 3u);
  EXPECT_EQ(row.first.tries, 4u);
  EXPECT_EQ(score.none_named.hits, 1u);
  EXPECT_EQ(score.misled.hits, 2u);  // the wide group, and the single load
  EXPECT_EQ(score.misled_by_kind.at("outside").hits, 1u);
  EXPECT_EQ(score.outside_called.hits, 1u);
  EXPECT_EQ(score.reliability[3].right.tries, 4u);
  EXPECT_EQ(score.reliability[3].right.hits, 1u);  // names, not groups
  EXPECT_EQ(score.reliability[0].right.tries, 3u);
  EXPECT_EQ(score.own_all.within.hits, 6u);
  EXPECT_EQ(score.stated_all.within.tries, 0u);
  EXPECT_NE(motion_score_text(score).find("2/4 50 %"), std::string::npos);
}

TEST(MotionScore, RequiresBothOfAPair) {
  const NamedEffect group{"brush_drop", 0.8, {"coulomb_friction", "slope"}, 1, 0.1};
  const NamedEffect slope{"slope", 0.8, {}, 1, 0.1}, other{"wheel_slip", 0.8, {}, 1, 0.1};
  std::vector<MotionOutcome> outcomes;
  const std::vector<std::string> truth{"coulomb_friction", "slope"};
  outcomes.push_back(said(Kind::pair, 0.2, truth, "effects", {group}));
  outcomes.push_back(said(Kind::pair, 0.2, truth, "effects", {slope, group}));
  outcomes.push_back(said(Kind::pair, 0.2, truth, "effects", {other, slope, group}));
  const MotionScore score = motion_score_of(outcomes);
  EXPECT_EQ(score.rows[3].pair_both.hits, 2u);
  EXPECT_EQ(score.rows[3].pair_exact.hits, 1u);
}

TEST(MotionScore, SeparatesStatedErrors) {
  MotionOutcome o = said(Kind::none, 0, {}, "effects", {});
  o.explanation_error = 0.2;
  o.answer.referee_error = 0.1;
  o.answer.explanation_error = 0.104;
  const MotionScore score = motion_score_of(std::vector{o, said(Kind::none, 0, {}, "none", {})});
  EXPECT_EQ(score.own_all.within.hits, 1u);
  EXPECT_EQ(score.own_all.within.tries, 2u);
  EXPECT_EQ(score.own_found.within.hits, 0u);
  EXPECT_EQ(score.stated_all.within.hits, 1u);
  EXPECT_EQ(score.stated_found.within.tries, 1u);
  EXPECT_NEAR(score.stated_found.median, 1.04, 1e-12);
}

TEST(MotionScore, RequiresExactVerdict) {
  const NamedEffect coulomb{"coulomb_friction", 0.9, {}, 1, 0.1}, slope{"slope", 0.9, {}, 1, 0.1};
  EXPECT_TRUE(verdict_right(said(Kind::none, 0, {}, "none", {})));
  EXPECT_FALSE(verdict_right(said(Kind::none, 0, {}, "inconclusive", {})));
  EXPECT_TRUE(verdict_right(said(Kind::outside, 0.1, {"x_bursts"}, "inconclusive", {slope})));
  EXPECT_FALSE(verdict_right(said(Kind::outside, 0.1, {"x_bursts"}, "not_this_robot", {})));
  EXPECT_TRUE(verdict_right(said(Kind::single, 0.1, {"slope"}, "effects", {slope})));
  EXPECT_FALSE(verdict_right(said(Kind::single, 0.1, {"slope"}, "effects", {slope, coulomb})));
  EXPECT_FALSE(verdict_right(said(Kind::single, 0.1, {"slope"}, "inconclusive", {slope})));
  EXPECT_TRUE(
      verdict_right(said(Kind::pair, 0.1, {"slope", "coulomb_friction"}, "effects", {coulomb, slope})));
  EXPECT_FALSE(verdict_right(said(Kind::pair, 0.1, {"slope", "coulomb_friction"}, "effects", {coulomb})));
}

}  // namespace
}  // namespace joulecast::trial::motion
