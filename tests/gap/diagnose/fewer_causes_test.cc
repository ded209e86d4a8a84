#include "gap/diagnose/fewer_causes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "made_drives.h"

namespace joulecast::gap {
namespace {

using made::cause;
using made::Drives;

// What the evidence is made to say of these causes: that they are there, one as surely as the other.
class ParsimonyJudged {
 public:
  ParsimonyJudged(const Drives& drives, const std::vector<std::string>& ids)
      : linear_(linearise(drives.material(), {}, std::array{0.3}, {})),
        problem_(make_problem(*linear_.columns, linear_.rows, linear_.noise, drives.material().blocks)) {
    Explanation explanation;
    for (const std::string& id : ids) {
      const auto at = std::ranges::find(problem_.hypotheses, id, &Hypothesis::id);
      Member m;
      m.hypothesis = static_cast<std::size_t>(at - problem_.hypotheses.begin());
      m.by_evidence = m.by_prediction = m.group_by_evidence = m.group_by_prediction = sure;
      m.any_by_evidence = m.any_by_prediction = sure;
      explanation.members.push_back(m);
      explanation.whole.push_back(m.hypothesis);
    }
    std::ranges::sort(explanation.whole);
    answer_ = explanation;
    prefer_fewer_causes({*linear_.columns, linear_.rows, linear_.noise}, Mixture(problem_), answer_);
  }

  std::vector<std::string> ids() const {
    std::vector<std::string> ids;
    for (const Member& m : answer_.members) ids.push_back(problem_.hypotheses[m.hypothesis].id());
    return ids;
  }
  // With its group.
  std::vector<std::string> group() const {
    std::vector<std::string> ids{problem_.hypotheses[answer_.members.front().hypothesis].id()};
    for (const Alternative& a : answer_.members.front().alternatives)
      ids.push_back(problem_.hypotheses[a.hypothesis].id());
    return ids;
  }
  const Member& member() const { return answer_.members.front(); }

  static constexpr double sure = 0.97;

 private:
  Linear linear_;
  Problem problem_;
  Explanation answer_;
};

bool holds(const std::vector<std::string>& ids, const std::string& id) {
  return std::ranges::find(ids, id) != ids.end();
}

TEST(FewerCauses, TheOneThatIsThereTakesThePlaceOfTwoThatAreNot) {
  const ParsimonyJudged judged(Drives({cause("coulomb_friction", 0.6)}),
                               {"accessory_load", "viscous_friction"});
  ASSERT_EQ(judged.ids().size(), 1u);
  EXPECT_TRUE(holds(judged.group(), "coulomb_friction"));
  EXPECT_FALSE(holds(judged.group(), "accessory_load"));
  // Two judges disagree.
  EXPECT_LE(judged.member().probability(), 0.7);
  EXPECT_GT(judged.member().group_probability(), 0.5);
}

TEST(FewerCauses, TwoThatAreThereStayTwo) {
  const ParsimonyJudged judged(Drives({cause("turning_scrub", 0.3), cause("accessory_load", 6)}),
                               {"accessory_load"});
  EXPECT_EQ(judged.ids().size(), 2u);
  EXPECT_TRUE(holds(judged.ids(), "turning_scrub"));
}

TEST(FewerCauses, WhatBothJudgesSayStaysAsItIs) {
  const ParsimonyJudged judged(Drives({cause("turning_scrub", 0.3)}), {"turning_scrub"});
  EXPECT_EQ(judged.ids(), std::vector<std::string>{"turning_scrub"});
  EXPECT_EQ(judged.member().probability(), ParsimonyJudged::sure);
}

TEST(FewerCauses, NothingIsNamedWhereNothingIs) {
  const ParsimonyJudged judged(Drives({}), {});
  EXPECT_TRUE(judged.ids().empty());
}

}  // namespace
}  // namespace joulecast::gap
