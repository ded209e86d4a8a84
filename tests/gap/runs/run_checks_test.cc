#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "gap/posterior/catalogue.h"
#include "gap/runs/diagnose_runs.h"
#include "gap/runs/run_rows.h"
#include "made_runs.h"

namespace joulecast::gap {
namespace {

constexpr double load_w = 6;

// Runs of a robot that draws 6 W more than its file, altered by `change`.
RunDiagnosis checked_runs(const std::function<void(RunSet&)>& change) {
  const robot::RobotModel robot = testing::nomad();
  std::mt19937_64 random(3);
  RunSet set;
  for (int k = 0; k < 40; ++k)
    set.runs.push_back(testing::made(robot, testing::drawn(random), {.load_w = load_w}, 0.02, random));
  change(set);
  return *diagnose_runs(set, robot);
}

void expect_contradicted(const RunDiagnosis& r, const std::string& id, const std::string& begins) {
  const Diagnosis& d = r.diagnosis;
  ASSERT_EQ(d.checks.size(), 1u);
  EXPECT_EQ(d.checks[0].id, id);
  EXPECT_TRUE(d.checks[0].contradicted);
  EXPECT_TRUE(d.checks[0].says.starts_with(begins)) << d.checks[0].says;
  EXPECT_EQ(name_of(d.verdict), "inconclusive");
  EXPECT_TRUE(d.effects.empty());
  EXPECT_TRUE(d.adoptable.empty());
}

TEST(RunChecks, AcceptsCorrectRuns) {
  EXPECT_TRUE(checked_runs([](RunSet&) {}).diagnosis.checks.empty());
}

TEST(RunChecks, ReportsEnergiesInOtherUnit) {
  for (const auto& [divisor, unit] : {std::pair{3600.0, "Wh"}, std::pair{1000.0, "kJ"}}) {
    const RunDiagnosis r = checked_runs([&, by = divisor](RunSet& set) {
      for (MissionRun& run : set.runs) run.energy_j /= by;
    });
    expect_contradicted(r, "energy_unit", "energy_j looks given in " + std::string(unit) + ":");
  }
}

TEST(RunChecks, ReportsConstantEnergies) {
  expect_contradicted(checked_runs([](RunSet& set) {
                        for (MissionRun& run : set.runs) run.energy_j = set.runs.front().energy_j;
                      }),
                      "constant_channel", "energy_j is ");
}

TEST(RunChecks, ReportsPayloadOverLimit) {
  const Diagnosis d = checked_runs([](RunSet& set) { set.runs[7].at.payload_kg = 5000; }).diagnosis;
  const auto over = std::ranges::find(d.checks, "payload_over_limit", &Check::id);
  ASSERT_NE(over, d.checks.end());
  EXPECT_TRUE(over->says.starts_with("payload_kg of run ")) << over->says;
  EXPECT_FALSE(over->contradicted);
}

// One run in 40 is short with little energy, or has tenfold energy. It is named and does not bias the load.
TEST(RunChecks, NamesOutlierRun) {
  for (const bool small : {true, false}) {
    const RunDiagnosis r = checked_runs([&](RunSet& set) {
      MissionRun& run = set.runs[7];
      run.name = "odd";
      if (small) {
        run.at = {.distance_m = 0.5, .speed_m_s = 0.4, .acceleration_m_s2 = 0.35};
        run.energy_j = 4;
      } else {
        run.energy_j *= 10;
      }
    });
    const Diagnosis& d = r.diagnosis;
    ASSERT_EQ(d.checks.size(), 1u) << small;
    EXPECT_EQ(d.checks[0].id, "run_apart");
    EXPECT_TRUE(d.checks[0].says.starts_with("Run odd took ")) << d.checks[0].says;
    ASSERT_EQ(d.effects.size(), 1u);
    EXPECT_TRUE(d.effects[0].id == "accessory_load" ||
                std::ranges::count(d.effects[0].alternatives, "accessory_load") > 0)
        << d.effects[0].id;
    if (d.effects[0].id == "accessory_load") {
      const DiagnosedParameter& p = d.effects[0].parameters.front();
      EXPECT_NEAR(p.value, load_w, 0.15 * load_w) << small;
      EXPECT_LT(p.deviation, 0.2 * load_w) << small;
    }
  }
}

// A covariate with values near zero is centred at zero. A covariate without such values has no meaningful
// zero and is centred at its median. The zero level of a label is arbitrary.
TEST(RunCovariates, CentresNearZeroCovariates) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> heater(2, 60), temperature(18, 28);
  RunSet set;
  set.covariates = {"heater_w", "temperature_c"};
  set.labels = {"surface"};
  for (int k = 0; k < 20; ++k) {
    set.runs.push_back(testing::made(testing::nomad(), testing::drawn(random), {}, 0.02, random));
    set.runs.back().covariates = {heater(random), temperature(random)};
    set.runs.back().labels = {k % 2 == 0 ? "hard" : "carpet"};
  }
  set.runs[5].covariates = {MissionRun::absent, MissionRun::absent};
  const RunRows rows(set, testing::nomad(), {});
  const std::vector<Modulation> by = modulations_of(rows.data.rows.instants);
  ASSERT_EQ(by.size(), 3u);
  const auto covariate = [&](std::size_t run, std::size_t index) {
    return by[index].of(rows.data.rows.window(run));
  };
  double least = 1, most = 0;
  for (std::size_t k = 0; k < set.runs.size(); ++k) {
    if (k != 5) {
      EXPECT_DOUBLE_EQ(covariate(k, 0), set.runs[k].covariates[0]);
    }
    least = std::min(least, covariate(k, 1));
    most = std::max(most, covariate(k, 1));
    EXPECT_DOUBLE_EQ(std::fabs(covariate(k, 2)), 0.5);
  }
  EXPECT_LT(least, 0);
  EXPECT_GT(most, 0);
  // Absent values are replaced by the median.
  EXPECT_GT(covariate(5, 0), 2);
  EXPECT_DOUBLE_EQ(covariate(5, 1), 0);
}

}  // namespace
}  // namespace joulecast::gap
