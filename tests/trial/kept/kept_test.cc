#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/study/trial/kept/kept_run.h"
#include "tests/study/trial/kept/kept_score.h"

namespace joulecast::trial::kept {
namespace {

using nlohmann::json;

KeptCase planted(const std::string& id, Kind kind, std::vector<PlantedEffect> effects = {}) {
  KeptCase kept;
  kept.id = id;
  kept.group = "virtual_robots";
  kept.channels = "all";
  kept.truth = KeptTruth{};
  kept.truth->kind = kind;
  kept.truth->effects = std::move(effects);
  return kept;
}

EngineAnswer answered(const std::string& verdict, std::vector<motion::NamedEffect> causes) {
  EngineAnswer answer;
  answer.verdict = verdict;
  answer.effects = std::move(causes);
  return answer;
}

motion::NamedEffect cause(const std::string& id, double probability,
                          std::vector<std::string> alternatives = {}) {
  return {id, probability, std::move(alternatives), 1, 0.1};
}

KeptScore score_one(const KeptCase& kept, const EngineAnswer& answer) {
  return score_kept({kept}, {{kept.id, answer}}).front().second;
}

TEST(KindInTurn, ReturnsMixOfTwenty) {
  std::map<Kind, std::size_t> before;
  for (std::size_t index = 0; index < 60; ++index) {
    const Kind kind = kind_in_turn(index);
    EXPECT_EQ(turn_in_kind(index), before[kind]++) << index;
    if (index % 20 != 19) continue;
    const std::size_t rounds = index / 20 + 1;
    EXPECT_EQ(before[Kind::single], 9 * rounds);
    EXPECT_EQ(before[Kind::pair], 4 * rounds);
    EXPECT_EQ(before[Kind::none], 4 * rounds);
    EXPECT_EQ(before[Kind::outside], 3 * rounds);
  }
}

TEST(KeptScore, ReturnsWilsonIntervalOfNames) {
  std::vector<KeptCase> cases;
  Answers answers;
  for (const double probability : {0.49, 0.2, 0.3, 0.1}) {
    cases.push_back(planted(std::to_string(cases.size()), Kind::none));
    answers[cases.back().id] = answered("effects", {cause("slope", probability)});
  }
  const Rate none = score_kept(cases, answers).front().second.none_named;
  EXPECT_EQ(none.hits, 0u);
  const double z2 = 1.959964 * 1.959964;
  EXPECT_NEAR(none.interval()[1], z2 / (4 + z2), 1e-12);  // upper limit without hits
  answers[cases[0].id] = answered("inconclusive", {cause("slope", 0.5)});
  const Rate named = score_kept(cases, answers).front().second.none_named;
  EXPECT_EQ(named.hits, 1u);
  // Wilson 1927: roots of (p - 1/4)^2 = z^2 p (1 - p) / 4.
  for (const double p : named.interval()) EXPECT_NEAR((p - 0.25) * (p - 0.25), z2 * p * (1 - p) / 4, 1e-12);
}

TEST(KeptScore, RequiresOneExactName) {
  const KeptCase kept = planted("a", Kind::single, {{"slope", 1.0}});
  EXPECT_EQ(score_one(kept, answered("effects", {cause("slope", 0.9)})).exact.hits, 1u);
  EXPECT_EQ(score_one(kept, answered("effects", {cause("slope", 0.9), cause("brush_drop", 0.4)})).exact.hits,
            1u);
  EXPECT_EQ(score_one(kept, answered("effects", {cause("slope", 0.9), cause("brush_drop", 0.5)})).exact.hits,
            0u);
  EXPECT_EQ(score_one(kept, answered("inconclusive", {cause("slope", 0.9)})).exact.hits, 0u);
  EXPECT_EQ(score_one(kept, answered("effects", {cause("slope", 0.4)})).exact.hits, 0u);
}

TEST(KeptScore, LimitsGroupsToThreeEffects) {
  const KeptCase kept = planted("a", Kind::single, {{"slope", 1.0}});
  const KeptScore group =
      score_one(kept, answered("effects", {cause("wheel_slip", 0.9, {"slope", "grade"})}));
  EXPECT_EQ(group.first.hits, 0u);
  EXPECT_EQ(group.in_group.hits, 1u);
  EXPECT_EQ(group.exact.hits, 1u);
  EXPECT_EQ(group.sure_and_wrong.hits, 0u);
  EXPECT_EQ(group.effect_true[2].right.hits, 0u);
  EXPECT_EQ(group.group_true[2].right.hits, 1u);
  const KeptScore wide =
      score_one(kept, answered("effects", {cause("wheel_slip", 0.9, {"slope", "grade", "brush_drop"})}));
  EXPECT_EQ(wide.in_group.hits, 0u);
  EXPECT_EQ(wide.sure_and_wrong.hits, 1u);
}

TEST(KeptScore, RequiresBothNamesOfPair) {
  const KeptCase kept = planted("a", Kind::pair, {{"slope", 1.0}, {"brush_drop", 1.0}});
  const auto group = cause("wheel_slip", 0.8, {"slope", "brush_drop"});
  EXPECT_EQ(score_one(kept, answered("effects", {group})).pair_named.hits, 0u);
  EXPECT_EQ(score_one(kept, answered("effects", {group})).pair_first.hits, 1u);
  EXPECT_EQ(score_one(kept, answered("effects", {group, cause("slope", 0.7)})).pair_exact.hits, 1u);
  const KeptScore more = score_one(
      kept, answered("effects", {cause("brush_drop", 0.9), cause("slope", 0.7), cause("grade", 0.6)}));
  EXPECT_EQ(more.pair_named.hits, 1u);
  EXPECT_EQ(more.pair_exact.hits, 0u);
}

TEST(KeptScore, CountsOutsideByVerdict) {
  const KeptCase kept = planted("a", Kind::outside, {{"x_caster", 1.0}});
  EXPECT_EQ(score_one(kept, answered("outside", {})).outside.hits, 1u);
  EXPECT_EQ(score_one(kept, answered("inconclusive", {})).outside.hits, 0u);
  EXPECT_EQ(score_one(kept, answered("inconclusive", {})).outside_or_inconclusive.hits, 1u);
  EXPECT_EQ(score_one(kept, answered("not_this_robot", {})).outside_or_inconclusive.hits, 0u);
}

TEST(KeptScore, ComparesStrengthsAndErrors) {
  const KeptCase kept = planted("a", Kind::single, {{"slope", 1.25}});
  EngineAnswer answer = answered("effects", {cause("slope", 0.9)});  // 1 +- 0.1
  answer.referee_error = 0.1;
  answer.explanation_error = 0.106;
  const KeptScore far = score_one(kept, answer);
  EXPECT_EQ(far.strength_close.hits, 0u);
  EXPECT_EQ(far.held_out.hits, 0u);
  answer.effects[0].deviation = 0.13;
  answer.explanation_error = 0.105;
  const KeptScore near = score_one(kept, answer);
  EXPECT_EQ(near.strength_close.hits, 1u);
  EXPECT_EQ(near.held_out.hits, 1u);
  EXPECT_EQ(near.held_out.tries, 1u);
}

TEST(KeptScore, ComparesVerdictAndNames) {
  KeptCase a = planted("a", Kind::none), b = planted("b", Kind::none);
  a.truth = b.truth = KeptTruth{};
  a.truth->other = "b";
  b.truth->other = "a";
  const auto agreement = [&](const EngineAnswer& x, const EngineAnswer& y) {
    return score_kept({a, b}, {{"a", x}, {"b", y}}).front().second.halves_agree;
  };
  const auto slope = answered("effects", {cause("slope", 0.9)});
  EXPECT_EQ(agreement(slope, answered("effects", {cause("grade", 0.8, {"slope"})})).hits, 1u);
  EXPECT_EQ(agreement(slope, answered("effects", {cause("grade", 0.8)})).hits, 0u);
  EXPECT_EQ(agreement(slope, answered("outside", {cause("slope", 0.9)})).hits, 0u);
  EXPECT_EQ(agreement(slope, slope).tries, 1u);
}

TEST(RealClass, FollowsRangesAndRefutations) {
  KeptTruth truth;
  truth.right = {{"accessory_load", 350.0, 700.0}};
  truth.neutral = {{"turning_scrub", {}, {}}};
  truth.outside = "heater";
  truth.refuted = "speed";
  motion::NamedEffect load = cause("accessory_load", 0.9);
  load.strength = 500;
  EXPECT_EQ(real_class(truth, answered("effects", {load})), "right");
  EXPECT_EQ(real_class(truth, answered("inconclusive", {load})), "inconclusive");
  load.strength = 900;
  EXPECT_EQ(real_class(truth, answered("effects", {load})), "misled");
  EXPECT_EQ(real_class(truth, answered("effects", {cause("turning_scrub", 0.95)})), "wrong");
  EXPECT_EQ(real_class(truth, answered("effects", {cause("turning_scrub", 0.95, {"accessory_load"})})),
            "right");
  EXPECT_EQ(real_class(truth, answered("effects", {cause("slope", 0.95)})), "misled");
  EngineAnswer outside = answered("outside", {});
  outside.outside_follows = "speed";
  EXPECT_EQ(real_class(truth, outside), "wrong");
  outside.verdict_probability = 0.95;
  EXPECT_EQ(real_class(truth, outside), "misled");
  outside.outside_follows = "Heater of the cabin";
  EXPECT_EQ(real_class(truth, outside), "right");
}

TEST(ParseAnswer, SortsCausesAndRejectsOthers) {
  const auto answer = parse_answer(
      R"({"verdict": "effects", "causes": [{"effect": "slope", "probability": 0.3}, {"effect": "grade", "probability":
      0.8, "strength": 2, "sd": 0.5, "alternatives": ["slope"]}], "held_out": {"regression": 0.2, "explanation": null}})");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->effects[0].id, "grade");
  EXPECT_EQ(answer->effects[0].deviation, 0.5);
  EXPECT_EQ(answer->referee_error, 0.2);
  EXPECT_FALSE(answer->explanation_error);
  for (const char* line : {"", "[]", R"({"verdict": "none"})", R"({"verdict": 1, "causes": []})",
                           R"({"verdict": "none", "causes": [{"probability": 1}]})"}) {
    EXPECT_FALSE(parse_answer(line)) << line;
  }
}

class KeptRuns : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder / "real/a");
    write("real/a/telemetry.lcmlog", "log");
    write("real/a/robot.json", "{}");
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder / name) << text; }
  std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("joulecast-kept-" + std::to_string(getpid()));
};

TEST_F(KeptRuns, ReadsLinesAndCounts) {
  write("cases", R"({"group": "foreign_plant", "channels": "battery", "seed": 3, "count": 4, "index": 2}
{"group": "real", "channels": "recorded", "recording": "real/a", "digest": "0a", "truth": {"right": [{"id": "slope", "to": 2}]}}
)");
  const auto cases = read_cases(folder / "cases");
  ASSERT_TRUE(cases);
  ASSERT_EQ(cases->size(), 5u);
  EXPECT_EQ((*cases)[3].id, "foreign_plant/battery/3/5");
  EXPECT_FALSE((*cases)[3].truth);
  EXPECT_EQ((*cases)[4].id, "real/a");
  EXPECT_EQ((*cases)[4].truth->right[0].to, 2);
  EXPECT_EQ(sample_of(*cases, 2).size(), 3u);
  std::string lines;
  for (const KeptCase& kept : *cases) lines += case_line(kept).dump() + "\n";
  write("again", lines);
  const auto again = read_cases(folder / "again");
  ASSERT_TRUE(again);
  for (std::size_t k = 0; k < cases->size(); ++k) EXPECT_EQ(case_line((*again)[k]), case_line((*cases)[k]));
  write("bad", "{\"group\": \"real\"}\n");
  EXPECT_FALSE(read_cases(folder / "bad"));
}

TEST_F(KeptRuns, RunsExternalEngine) {
  write("engine.sh",
        "test \"$2\" = --robot && printf '{\"verdict\": \"none\", \"causes\": [], \"log\": \"%s\"}' \"$(cat "
        "\"$1\" \"$3\")\"");
  const auto log = folder / "real/a/telemetry.lcmlog", robot = folder / "real/a/robot.json";
  const auto line = ask({"sh " + (folder / "engine.sh").string()}, log, robot);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->at("verdict"), "none");
  EXPECT_EQ(line->at("log"), "log{}");
  EXPECT_GE(line->at("cpu_s").get<double>(), 0);
  for (const char* command : {"false", "echo no answer"}) {
    const auto refused = ask({command}, log, robot);
    ASSERT_TRUE(refused);
    EXPECT_TRUE(refused->contains("refused")) << command;
    EXPECT_FALSE(parse_answer(refused->dump())->refused.empty());
  }
}

TEST_F(KeptRuns, ResumesFromKeptAnswers) {
  std::vector<KeptCase> cases{{}};
  cases[0].id = cases[0].recording = "real/a";
  cases[0].group = "real";
  cases[0].channels = "recorded";
  cases[0].truth = KeptTruth{};
  KeptRun run;
  run.recordings = folder;
  run.engine.command = "echo '{\"verdict\": \"none\", \"causes\": []}'  #";
  json kept_line;
  run.done = [&](const KeptCase&, const json& line) { kept_line = line; };
  ASSERT_TRUE(run_kept(run, cases));
  EXPECT_EQ(cases[0].digest.size(), 16u);
  write("answers", kept_line.dump() + "\n");
  const auto answers = read_answers(folder / "answers", cases);
  ASSERT_TRUE(answers);
  EXPECT_EQ(answers->at("real/a").verdict, "none");
  // Modified files do not match the case.
  write("real/a/robot.json", "{ }");
  EXPECT_FALSE(run_kept(run, cases));
  cases[0].digest = "0000000000000000";
  EXPECT_FALSE(read_answers(folder / "answers", cases));
  EXPECT_TRUE(read_answers(folder / "none", cases)->empty());
}

TEST(ScoreTable, ComparesOnCommonCases) {
  const std::vector<KeptCase> cases{planted("a", Kind::none), planted("b", Kind::none)};
  std::vector<KeptCase> groups = cases;
  groups[1].channels = "battery";
  const Answers one{{"a", answered("none", {})}, {"b", answered("none", {})}};
  const Answers other{{"a", answered("effects", {cause("slope", 0.95)})}};
  const std::string alone = score_table(cases, {{"one", one}});
  EXPECT_NE(alone.find("virtual_robots, channels: all (2 of 2 cases)"), std::string::npos) << alone;
  EXPECT_NE(alone.find("0/2 0 % [0, 66]"), std::string::npos) << alone;
  const std::string both = score_table(cases, {{"one", one}, {"other", other}});
  EXPECT_NE(both.find("(1 of 2 cases)"), std::string::npos) << both;
  EXPECT_NE(both.find("1/1 100 % [21, 100]"), std::string::npos) << both;
  EXPECT_EQ(both.find("all cases"), std::string::npos) << both;
  EXPECT_NE(score_table(groups, {{"one", one}}).find("all cases (2 of 2 cases)"), std::string::npos);
}

}  // namespace
}  // namespace joulecast::trial::kept
