#include "gap/mission_level.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <sstream>

#include "dynamics/straight.h"
#include "robot/robot_file.h"

namespace joulecast::gap {
namespace {

robot::RobotModel nomad() {
  return robot::load_robot(std::string(JOULECAST_SOURCE_DIR) + "/deploy/robots/nomad.json").value();
}

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

std::vector<MissionRun> runs_of(const std::string& rows) {
  const auto runs = read_mission_runs(thesis_header + rows, "runs.csv", nomad());
  EXPECT_TRUE(runs) << describe(runs.error());
  return *runs;
}

const DiagnosedEffect* find(const MissionDiagnosis& d, const std::string& id) {
  const auto found = std::ranges::find(d.effects, id, &DiagnosedEffect::id);
  return found == d.effects.end() ? nullptr : &*found;
}

// (3-2), (3-3) against what the robot measured. The stated 10 m leave a part that all runs share, the
// payload's part is left over whatever that is: with 14 m, which the printed model values ask for, it stands
// alone.
TEST(ThesisTables, ShowLoadDependentRollingResistance) {
  const std::string rows = straight_runs() + curve_runs();
  if (rows.empty()) GTEST_SKIP() << "no shared tables beside the project";
  std::vector<MissionRun> runs = runs_of(rows);
  for (const double stretch : {1.0, 1.4}) {
    SCOPED_TRACE(stretch);
    for (MissionRun& run : runs) {
      run.at.distance_m *= stretch;
      run.at.turn_radius_m *= stretch;
    }
    const auto d = diagnose_runs(runs, nomad(), {true, {}});
    ASSERT_TRUE(d);
    EXPECT_FALSE(d->model_given);
    EXPECT_EQ(name_of(d->verdict), "effects");
    const DiagnosedEffect* load = find(*d, "load_rolling_resistance");
    ASSERT_NE(load, nullptr);
    EXPECT_GT(load->probability, 0.8);
    // Of effects of the catalogue none does the same.
    EXPECT_TRUE(std::ranges::all_of(load->alternatives,
                                    [](const std::string& id) { return id.starts_with("outside:"); }));
    // Solid tyres on hard floor roll with 0.01 to 0.03.
    const DiagnosedParameter& strength = load->parameters.front();
    EXPECT_GT(strength.value + 2 * strength.deviation, 0.01);
    EXPECT_LT(strength.value - 2 * strength.deviation, 0.03);
    EXPECT_GT(strength.value, 4 * strength.deviation);
    // Runs left out, the effects chosen without them.
    EXPECT_EQ(d->folds, runs.size());
    EXPECT_EQ(d->folds_agreeing, d->folds);
    EXPECT_GT(d->left_out.interval[0], 0.3);
    EXPECT_EQ(d->effects.size(), stretch > 1 ? 1u : 2u);
  }
}

// The printed model columns hold more payload than (3-2) gives: against them nothing is decided, which the
// diagnosis must say rather than name an effect.
TEST(ThesisTables, PrintedModelEnergiesDecideNothing) {
  const std::string rows = straight_runs() + curve_runs();
  if (rows.empty()) GTEST_SKIP() << "no shared tables beside the project";
  const auto d = diagnose_runs(runs_of(rows), nomad());
  ASSERT_TRUE(d);
  EXPECT_TRUE(d->model_given);
  EXPECT_NE(name_of(d->verdict), "effects");
  EXPECT_TRUE(d->effects.empty());
  // Ratio of what is printed to (3-2) with the stated distances: FACTS, 14 m instead of 10 m, and more.
  EXPECT_GT(d->model_ratio, 1.3);
  EXPECT_TRUE(
      std::ranges::any_of(d->limits, [](const std::string& l) { return l.find("given model") < l.size(); }));
}

// (3-6) with l half the track halves the turning term. It moves energy between the sides and hardly their
// sum, so that it cannot be what the payload adds; nor do the sides differ as it says.
TEST(ThesisTables, HalvedTurningTermExplainsLittle) {
  const std::string rows = curve_runs();
  if (rows.empty()) GTEST_SKIP() << "no shared tables beside the project";
  const auto d = diagnose_runs(runs_of(rows), nomad());
  ASSERT_TRUE(d && d->turning);
  EXPECT_EQ(d->turning->runs, 8u);
  // l times the angle turned, over the length driven: each side's way is off by half of 0.165 pi/2 / 4.1.
  EXPECT_NEAR(d->turning->side_difference, 0.5 * 0.165 * std::numbers::pi / 2 / 4.1, 0.006);
  EXPECT_LT(std::fabs(d->turning->sum), 0.01);
  EXPECT_LT(d->turning->share + 2 * d->turning->share_sd, 1.0);
}

// Runs made with the drive model, known effects and scatter like a robot's.
struct Made {
  std::vector<MissionRun> runs;
  std::vector<robot::AdoptedEffect> truth;
};

Made made_runs(std::vector<robot::AdoptedEffect> truth, unsigned seed, double scatter = 0.02) {
  robot::RobotModel robot = nomad();
  robot.effects = truth;
  const auto model = dynamics::drive_model(robot).value();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, scatter);
  Made made{{}, std::move(truth)};
  for (const double payload : {0.0, 4.0, 8.0}) {
    for (const double speed : {0.25, 0.5, 1.0}) {
      for (const double turn : {0.0, 3.0}) {
        MissionRun run;
        run.at = {12, speed, 0.3, payload, turn, 1.5, speed < 0.3 ? 30.0 : 0.0};
        run.energy_j = run_energy(model, run.at).battery_j * (1 + normal(random));
        made.runs.push_back(run);
      }
    }
  }
  return made;
}

TEST(MadeRuns, NamesTheEffectThatMadeThem) {
  const std::map<std::string, double> strengths{
      {"load_rolling_resistance", 0.03}, {"accessory_load", 5.0}, {"turning_scrub", 0.3}};
  const std::map<std::string, std::string> names{{"load_rolling_resistance", "coefficient"},
                                                 {"accessory_load", "power_w"},
                                                 {"turning_scrub", "coefficient"}};
  for (const auto& [id, strength] : strengths) {
    SCOPED_TRACE(id);
    const Made made = made_runs({{id, {{names.at(id), strength}}}}, 7);
    const auto d = diagnose_runs(made.runs, nomad());
    ASSERT_TRUE(d);
    EXPECT_EQ(name_of(d->verdict), "effects");
    ASSERT_EQ(d->effects.size(), 1u);
    const DiagnosedEffect& e = d->effects.front();
    std::vector<std::string> group = e.alternatives;
    group.push_back(e.id);
    EXPECT_TRUE(std::ranges::find(group, id) != group.end());
    if (e.id == id) {
      EXPECT_NEAR(e.parameters[0].value, strength, 4 * e.parameters[0].deviation);
    }
    EXPECT_GT(d->left_out.interval[0], 0);
  }
}

TEST(MadeRuns, NamesNothingWhereOnlyScatterIs) {
  int named = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const auto d = diagnose_runs(made_runs({}, seed).runs, nomad());
    ASSERT_TRUE(d);
    named += d->effects.empty() ? 0 : 1;
  }
  EXPECT_EQ(named, 0);
}

// The quadrature against the closed form of a straight run: dE of both motors by (4-1).
TEST(RunEnergy, AgreesWithTheClosedForm) {
  const robot::RobotModel robot = nomad();
  const auto model = dynamics::drive_model(robot).value();
  const auto power = dynamics::straight_power(robot, 5).over_distance();
  const double a = 0.2, v = 0.8, distance = 10, rise = v / a, cruise = distance / v - rise;
  // Speed v(t) = a t and back: terms odd in the acceleration cancel between starting and braking.
  const double expected = 2 * rise * (power.c1 * a * a + power.c2 * v * v / 3 + power.c3 * v / 2 + power.c0) +
                          cruise * power.power_w(v, 0);
  const RunEnergy energy = run_energy(model, {distance, v, a, 5, 0, 0, 0});
  // Friction fades below 0.005 rad/s, which the closed form leaves out: 0.005 rad/s of 8.
  EXPECT_NEAR(energy.motor_j[0] + energy.motor_j[1], expected, 1e-3 * expected);
  EXPECT_NEAR(energy.duration_s, 2 * rise + cruise, 1e-9);
  EXPECT_NEAR(energy.battery_j,
              energy.motor_j[0] + energy.motor_j[1] + robot.idle_power_w * energy.duration_s,
              1e-6 * expected);
}

TEST(RunEnergy, TurnsMoveEnergyToTheOuterWheel) {
  const auto model = dynamics::drive_model(nomad()).value();
  const RunEnergy straight = run_energy(model, {4, 0.5, 0.3, 0, 0, 0, 0});
  const RunEnergy left = run_energy(model, {4, 0.5, 0.3, 0, std::numbers::pi / 2, 1.5, 0});
  const RunEnergy right = run_energy(model, {4, 0.5, 0.3, 0, -std::numbers::pi / 2, 1.5, 0});
  EXPECT_GT(left.motor_j[0], straight.motor_j[0]);
  EXPECT_LT(left.motor_j[1], straight.motor_j[1]);
  EXPECT_GT(right.motor_j[1], straight.motor_j[1]);
  EXPECT_LT(right.motor_j[0], straight.motor_j[0]);
}

std::string error_of(const std::string& csv) {
  const auto runs = read_mission_runs(csv, "runs.csv", nomad());
  return runs ? "" : describe(runs.error());
}

TEST(RunTable, ErrorsNameRowAndColumn) {
  EXPECT_EQ(error_of("distance_m,energy_j\n10,100\n"), "runs.csv: line 1: column speed_m_s is required");
  EXPECT_EQ(error_of("distance_m,speed_m_s,joules\n10,1,100\n"),
            "runs.csv: line 1: column joules is none of a table of runs");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j\n10,1,100\n10,fast,100\n"),
            "runs.csv: line 3: column speed_m_s: 'fast' must be from 0.001 to 100 m/s");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j\n10,1,\n"),
            "runs.csv: line 2: column energy_j: '' is required unless right_j and left_j are given");
  EXPECT_EQ(error_of("distance_m,speed_m_s,right_j\n10,1,5\n"),
            "runs.csv: line 2: column left_j: '' is required beside the other motor's");
  EXPECT_EQ(error_of("distance_m,speed_m_s,turn_radius_m,turn_deg,turn_side,energy_j\n10,1,4,270,left,5\n"),
            "runs.csv: line 2: column turn_deg: '270' is an arc longer than distance_m");
  EXPECT_EQ(error_of("distance_m,speed_m_s,turn_radius_m,turn_side,energy_j\n10,1,4,up,5\n"),
            "runs.csv: line 2: column turn_side: 'up' must be left or right");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j\n10,1,100\n"),
            "runs.csv: holds 1 runs, at least 3 are needed");
}

}  // namespace
}  // namespace joulecast::gap
