#include "gap/runs/diagnose_runs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <sstream>

#include "made_runs.h"
#include "tests/support/shared_folder.h"

namespace joulecast::gap {
namespace {

using testing::Departure;
using testing::nomad;

// A table of the thesis: column name -> cell, row by row. Empty where the shared tables are absent.
std::vector<std::map<std::string, std::string>> shared_table(const std::string& name) {
  std::ifstream in(std::filesystem::path(JOULECAST_SHARED) / "seed/tables" / name);
  std::vector<std::map<std::string, std::string>> rows;
  std::vector<std::string> header;
  for (std::string line; std::getline(in, line);) {
    std::vector<std::string> cells;
    std::istringstream cut(line);
    for (std::string cell; std::getline(cut, cell, ',');) cells.push_back(cell);
    if (header.empty()) {
      header = cells;
      continue;
    }
    rows.emplace_back();
    for (std::size_t k = 0; k < cells.size(); ++k) rows.back()[header[k]] = cells[k];
  }
  return rows;
}

constexpr const char* thesis_header =
    "run,table,distance_m,speed_m_s,acceleration_m_s2,payload_kg,turn_radius_m,turn_deg,turn_side,right_j,"
    "left_j,model_right_j,model_left_j\n";

std::string energies(const std::map<std::string, std::string>& row) {
  return row.at("measured_right_J") + "," + row.at("measured_left_J") + "," + row.at("model_right_J") + "," +
         row.at("model_left_J") + "\n";
}

// Tables 3-3 and 3-4: 10 m straight, 4 s of acceleration (3.2.1).
std::string straight_runs() {
  std::ostringstream csv;
  for (const auto& row : shared_table("table_3-3_and_3-4.csv")) {
    const double a = std::stod(row.at("acceleration_m_s2"));
    csv << "," << (row.at("payload_kg") == "0" ? "3-3" : "3-4") << ",10," << 4 * a << "," << a << ","
        << row.at("payload_kg") << ",,,," << energies(row);
  }
  return csv.str();
}

// Tables 3-6 and 3-7: Bezier curves between points 2.7 m apart, started with 0.5 m/s^2 (3.2.2). Their length
// is not printed; measured energies over those of 10 m straight give about 4.1 m, a right angle's bend.
std::string curve_runs() {
  std::ostringstream csv;
  for (const auto& row : shared_table("table_3-6_and_3-7.csv")) {
    const double a = std::stod(row.at("acceleration_m_s2"));
    csv << "," << (row.at("payload_kg") == "0" ? "3-6" : "3-7") << ",4.1," << 4 * a << ",0.5,"
        << row.at("payload_kg") << ",1.8,90," << row.at("direction") << "," << energies(row);
  }
  return csv.str();
}

RunSet runs_of(const std::string& rows) {
  const RunFile file{"runs.csv", thesis_header + rows};
  const auto runs = read_runs({&file, 1}, nomad());
  EXPECT_TRUE(runs) << (runs ? "" : describe(runs.error()));
  return *runs;
}

const DiagnosedEffect* find(const RunDiagnosis& d, const std::string& id) {
  const auto& effects = d.diagnosis.effects;
  const auto found = std::ranges::find(effects, id, &DiagnosedEffect::id);
  return found == effects.end() ? nullptr : &*found;
}

// (3-2), (3-3) compared with the measurements. With the stated 10 m all runs share a residual, and the
// payload's part remains in any case. With 14 m, which fits the printed model values, only the payload's part
// remains.
TEST(ThesisTables, ShowsLoadRollingResistance) {
  const std::string rows = straight_runs() + curve_runs();
  JOULECAST_NEED_SHARED(!rows.empty(), "shared tables");
  RunSet runs = runs_of(rows);
  for (const double stretch : {1.0, 1.4}) {
    SCOPED_TRACE(stretch);
    for (MissionRun& run : runs.runs) {
      run.at.distance_m *= stretch;
      run.at.turn_radius_m *= stretch;
    }
    const auto d = diagnose_runs(runs, nomad(), true);
    ASSERT_TRUE(d);
    EXPECT_FALSE(d->model_given);
    const DiagnosedEffect* load = find(*d, "load_rolling_resistance");
    // With the stated distance, an offset common to all runs competes with it.
    if (load == nullptr && stretch == 1) continue;
    ASSERT_NE(load, nullptr);
    EXPECT_GT(load->group, stretch > 1 ? 0.8 : 0.5);
    // Solid tyres on hard floor have coefficients of 0.01 to 0.03. The loss of 14 m, divided by the stated
    // 10 m, gives 1.4 times the coefficient.
    const DiagnosedParameter& strength = load->parameters.front();
    EXPECT_GT(strength.value + 2 * strength.deviation, 0.01);
    EXPECT_LT(strength.value - 2 * strength.deviation, 0.03 * 1.4 / stretch);
    EXPECT_GT(strength.value, 4 * strength.deviation);
    // Held-out parts are excluded from all choices.
    ASSERT_TRUE(d->diagnosis.shrinkage);
    EXPECT_GT(d->diagnosis.shrinkage->interval[0], 0.3);
  }
}

// The printed model columns contain a larger payload term than (3-2). Compared with them the diagnosis is
// inconclusive and names no effect.
TEST(ThesisTables, RefusesPrintedModelEnergies) {
  const std::string rows = straight_runs() + curve_runs();
  JOULECAST_NEED_SHARED(!rows.empty(), "shared tables");
  const auto d = diagnose_runs(runs_of(rows), nomad());
  ASSERT_TRUE(d);
  EXPECT_TRUE(d->model_given);
  EXPECT_NE(d->diagnosis.verdict, Verdict::effects);
  EXPECT_FALSE(d->diagnosis.refusal.empty());
  // Ratio of the printed energies to (3-2) with the stated distances: FACTS, 14 m instead of 10 m, and more.
  EXPECT_GT(d->model_ratio, 1.3);
  EXPECT_TRUE(
      std::ranges::any_of(d->limits, [](const std::string& l) { return l.find("given model") < l.size(); }));
}

RunSet made(const Departure& departure, std::size_t runs, double scatter, unsigned seed) {
  std::mt19937_64 random(seed);
  RunSet set;
  for (std::size_t k = 0; k < runs; ++k)
    set.runs.push_back(testing::made(nomad(), testing::drawn(random), departure, scatter, random));
  return set;
}

RunDiagnosis diagnosed(const RunSet& set) {
  auto d = diagnose_runs(set, nomad());
  EXPECT_TRUE(d) << (d ? "" : describe(d.error()));
  return *d;
}

// The tests use the formulas of the robot file. The planted departure is the only one.
TEST(MadeRuns, AgreesWithModelFormulas) {
  for (const JudgedRun& run : diagnosed(made({}, 8, 0, 3)).runs)
    EXPECT_NEAR(run.model_j, run.run.energy_j, 0.004 * run.model_j);
}

TEST(MadeRuns, NamesLoadRollingResistance) {
  const RunDiagnosis d = diagnosed(made({.rolling = 0.03}, 40, 0.01, 47));
  ASSERT_EQ(d.diagnosis.effects.size(), 1u);
  const DiagnosedEffect& e = d.diagnosis.effects.front();
  EXPECT_EQ(e.id, "load_rolling_resistance");
  EXPECT_EQ(d.diagnosis.verdict, Verdict::effects);
  EXPECT_NEAR(e.parameters.front().value, 0.03, 3 * e.parameters.front().deviation);
  EXPECT_LT(e.parameters.front().deviation, 0.008);
}

TEST(MadeRuns, NamesConstantLoad) {
  const RunDiagnosis d = diagnosed(made({.load_w = 5}, 40, 0.03, 47));
  ASSERT_EQ(d.diagnosis.effects.size(), 1u);
  const DiagnosedEffect& e = d.diagnosis.effects.front();
  const bool grouped = std::ranges::find(e.alternatives, "accessory_load") != e.alternatives.end();
  EXPECT_TRUE(e.id == "accessory_load" || grouped) << e.id;
  if (e.id == "accessory_load") {
    EXPECT_NEAR(e.parameters.front().value, 5, 1);
  }
  EXPECT_LT(d.diagnosis.baseline->explanation_held_out, 1.05 * d.diagnosis.baseline->held_out);
}

// With scatter only, no effect is named and the scatter is estimated.
TEST(MadeRuns, EstimatesScatterAndNamesNothing) {
  int named = 0;
  for (const double scatter : {0.01, 0.03}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const RunDiagnosis d = diagnosed(made({}, 40, scatter, seed));
      named += d.diagnosis.effects.empty() ? 0 : 1;
      EXPECT_GT(d.scatter, 0.65 * scatter);
      EXPECT_LT(d.scatter, 1.5 * scatter);
    }
  }
  EXPECT_EQ(named, 0);
}

// Tables 3-3 and 3-4 in part, with a surface for every other run: six runs that these conditions describe
// completely.
TEST(ThesisTables, ExactFitsJudgeNothing) {
  const RunFile file{"runs.csv",
                     "table,distance_m,speed_m_s,acceleration_m_s2,payload_kg,right_j,left_j,label:surface\n"
                     "empty,10,0.5,0.125,0,53.67,56.25,tile\n"
                     "empty,10,0.7,0.175,0,56.33,60.26,carpet\n"
                     "empty,10,0.9,0.225,0,56.78,60.76,tile\n"
                     "loaded,10,0.5,0.125,8.25,64.81,67.56,carpet\n"
                     "loaded,10,0.7,0.175,8.25,66.38,70.40,tile\n"
                     "loaded,10,0.9,0.225,8.25,66.62,70.90,carpet\n"};
  const auto runs = read_runs({&file, 1}, nomad());
  ASSERT_TRUE(runs) << describe(runs.error());
  const Diagnosis d = diagnosed(*runs).diagnosis;
  EXPECT_EQ(d.verdict, Verdict::inconclusive);
  EXPECT_TRUE(d.effects.empty());
  ASSERT_EQ(d.reasons.size(), 1u);
  EXPECT_NE(d.reasons.front().find("too few runs"), std::string::npos) << d.reasons.front();
}

TEST(MadeRuns, NamesCovariateWithCoefficient) {
  std::mt19937_64 random(3);
  RunSet set;
  set.covariates = {"cpu_load", "temperature_c"};
  std::uniform_real_distribution<double> cpu(0, 1), temperature(5, 30);
  for (int k = 0; k < 40; ++k) {
    const double load = cpu(random);
    set.runs.push_back(testing::made(nomad(), testing::drawn(random), {.load_w = 8.6 * load}, 0.02, random));
    set.runs.back().covariates = {load, temperature(random)};
  }
  const RunDiagnosis d = diagnosed(set);
  const DiagnosedEffect* e = find(d, "covariate:cpu_load");
  ASSERT_NE(e, nullptr);
  EXPECT_GT(e->probability, 0.9);
  EXPECT_EQ(e->parameters.front().unit, "W/unit");
  EXPECT_NEAR(e->parameters.front().value, 8.6, 2.5 * e->parameters.front().deviation);
  EXPECT_EQ(find(d, "covariate:temperature_c"), nullptr);
  const auto& terms = d.diagnosis.baseline->terms;
  const auto term = std::ranges::find(terms, "covariate:cpu_load", &BaselineTerm::name);
  ASSERT_NE(term, terms.end());
  EXPECT_NEAR(term->value, 8.6, 4 * term->deviation);
}

TEST(MadeRuns, NamesSurfaceLabel) {
  std::mt19937_64 random(4);
  RunSet set;
  set.labels = {"surface"};
  for (int k = 0; k < 48; ++k) {
    const bool carpet = k % 2 == 1;
    set.runs.push_back(
        testing::made(nomad(), testing::drawn(random), {.friction_nm = carpet ? 0.3 : 0.0}, 0.01, random));
    set.runs.back().labels = {carpet ? "carpet" : "hard"};
  }
  const RunDiagnosis d = diagnosed(set);
  const DiagnosedEffect* e = find(d, "covariate:surface=hard");
  ASSERT_NE(e, nullptr);
  EXPECT_GT(e->probability, 0.8);
}

// A climb that is in the table and absent from the model.
TEST(MadeRuns, NamesGradeFromTable) {
  std::mt19937_64 random(5);
  RunSet set;
  const double weight_n = 9.80665 * (nomad().mass.chassis_kg + 2 * nomad().mass.wheel_kg);
  std::uniform_real_distribution<double> climb(-0.03, 0.03);
  for (int k = 0; k < 40; ++k) {
    RunConditions at = testing::drawn(random);
    at.payload_kg = 0;
    at.climb_m = climb(random) * at.distance_m;
    set.runs.push_back(
        testing::made(nomad(), at, {.slope_force_n = weight_n * at.climb_m / at.distance_m}, 0.02, random));
  }
  const RunDiagnosis d = diagnosed(set);
  const DiagnosedEffect* e = find(d, "grade");
  ASSERT_NE(e, nullptr);
  EXPECT_NEAR(e->parameters.front().value, 1, 3 * e->parameters.front().deviation);
}

}  // namespace
}  // namespace joulecast::gap
