#include "ingest/pipeline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>

#include "signals/sample.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::ingest {
namespace {

using signals::MissionEvent;
using signals::MissionPhase;
using signals::Sample;
using testing::PipelineHarness;

constexpr std::int64_t start_us = 1'750'000'000'000'000;

Sample sample(std::int64_t sequence, double power_w = 48) {
  Sample s;
  s.utime_us = start_us + sequence * 20'000;
  s.sequence = sequence;
  s.wheel_velocity_rad_s = {3, 3};
  s.battery_voltage_v = 24;
  s.battery_current_a = power_w / 24;
  s.payload_kg = 2;
  return s;
}

MissionEvent event(MissionPhase phase, std::int64_t sequence, const std::string& id = "m1") {
  return {start_us + sequence * 20'000 - 5'000, id, phase, 2, ""};
}

class PipelineTest : public ::testing::Test {
 protected:
  void SetUp() override { harness.add_robot(testing::nomad()); }

  void send(const Sample& s) { harness.pipeline->handle({"nomad", s, s.utime_us}); }
  void send(const MissionEvent& e) { harness.pipeline->handle({"nomad", e, e.utime_us}); }
  void send(std::int64_t sequence, std::vector<signals::Covariate> covariates) {
    const std::int64_t at_us = start_us + sequence * 20'000;
    harness.pipeline->handle({"nomad", signals::CovariateMessage{at_us, std::move(covariates)}, at_us});
  }
  std::vector<signals::CovariateChange> changes(history::MissionKey key) {
    const auto page = harness.store->covariates(key, {}, {.limit = 10'000, .cursor = {}});
    EXPECT_TRUE(page);
    return page ? page->items : std::vector<signals::CovariateChange>{};
  }
  void send_range(std::int64_t from, std::int64_t to) {
    for (std::int64_t k = from; k < to; ++k) send(sample(k));
  }

  PipelineHarness harness;
};

TEST_F(PipelineTest, AccountsAWholeMission) {
  send(event(MissionPhase::started, 0));
  send_range(0, 501);
  send(event(MissionPhase::finished, 502));
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_EQ(missions[0].state, history::MissionState::finished);
  EXPECT_EQ(missions[0].mission_id, "m1");
  EXPECT_FALSE(missions[0].implicit);
  EXPECT_FALSE(missions[0].incomplete);
  EXPECT_EQ(missions[0].samples, 501);
  EXPECT_NEAR(missions[0].accounts.measured_j, 480, 1e-6);
  EXPECT_NEAR(missions[0].accounts.duration_s, 10, 1e-9);
  EXPECT_NEAR(missions[0].accounts.distance_m, 3, 1e-6);
  EXPECT_NEAR(missions[0].accounts.ledger.total(), missions[0].accounts.battery_j, 1e-9 * 480);
  const auto trace = harness.store->trace(missions[0].key, {}, 1000);
  ASSERT_TRUE(trace);
  EXPECT_EQ(trace->buckets.size(), 11u);
  const auto raw = harness.store->telemetry(missions[0].key, {}, {.limit = 1000, .cursor = {}});
  ASSERT_TRUE(raw);
  EXPECT_EQ(raw->items.size(), 501u);
  EXPECT_TRUE(harness.warnings.empty());
}

TEST_F(PipelineTest, SummarizesCovariatesByMission) {
  send(-100, {{"ambient_c", 21}, {"surface=ice", 0}});
  send(event(MissionPhase::started, 0));
  send_range(0, 100);
  send(100, {{"cpu_load", 0.25}, {"ambient_c", 21}, {"surface=ice", 1}});
  send_range(100, 400);
  send(400, {{"cpu_load", 1}, {"surface=ice", 0}, {"ambient_c", signals::unmeasured}});
  send_range(400, 501);
  send(event(MissionPhase::finished, 501));
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 1u);
  const auto& covariates = missions[0].covariates;
  ASSERT_EQ(covariates.size(), 3u);
  EXPECT_EQ(covariates[0].name, "ambient_c");  // it held before the mission began
  EXPECT_EQ(covariates[0].mean, 21);
  EXPECT_NEAR(covariates[0].known_s, 8.005, 1e-9);
  EXPECT_EQ(covariates[1].name, "cpu_load");
  EXPECT_EQ(covariates[1].min, 0.25);
  EXPECT_EQ(covariates[1].max, 1);
  EXPECT_NEAR(covariates[1].known_s, 8.015, 1e-9);
  EXPECT_NEAR(covariates[1].mean, (6 * 0.25 + 2.015 * 1) / 8.015, 1e-9);
  EXPECT_EQ(covariates[2].name, "surface=ice");
  EXPECT_NEAR(covariates[2].mean, 6 / 8.015, 1e-9);
  const auto series = signals::series_of(changes(missions[0].key));
  ASSERT_EQ(series.size(), 3u);
  EXPECT_EQ(series[0].utime_us, (std::vector<std::int64_t>{start_us - 5'000, start_us + 8'000'000}));
  EXPECT_EQ(series[1].value, (std::vector<double>{0.25, 1}));
  EXPECT_EQ(harness.counters.covariate_changes, 5u);

  // Values that apply continue in the next mission; the others are no covariates of it.
  send(event(MissionPhase::started, 1000, "m2"));
  send_range(1000, 1100);
  send(event(MissionPhase::finished, 1100, "m2"));
  const auto next = harness.missions().back().covariates;
  ASSERT_EQ(next.size(), 1u);
  EXPECT_EQ(next[0].name, "cpu_load");
  EXPECT_EQ(next[0].mean, 1);
}

TEST_F(PipelineTest, CovariatesNameMapAndLevel) {
  send(10, {{"map=hall", 1}, {"level=2", 1}, {"surface=ice", 1}});
  send_range(11, 20);
  harness.pipeline->publish();
  const auto there = harness.fleet.find("nomad");
  EXPECT_EQ(there->map, "hall");
  EXPECT_EQ(there->level, "2");
  send(20, {{"level=2", 0}, {"level=3", 1}});
  send_range(20, 30);
  harness.pipeline->publish();
  EXPECT_EQ(harness.fleet.find("nomad")->level, "3");
}

TEST_F(PipelineTest, CountsRejectedCovariates) {
  send(event(MissionPhase::started, 0));
  send_range(0, 10);
  send(10, {{"load", INFINITY}, {"floor=ice", 0.5}, {"load", 1}});
  send(9, {{"load", 2}});
  for (int k = 0; k < 70; ++k) send(11, {{"c" + std::to_string(k), 1}});
  harness.pipeline->handle({"nomad", signals::CovariateMessage{-1, {{"load", 1}}}, start_us});
  send(event(MissionPhase::finished, 12));
  EXPECT_EQ(harness.faults(IngestFault::implausible), 3u);
  EXPECT_EQ(harness.faults(IngestFault::late), 1u);
  EXPECT_EQ(harness.faults(IngestFault::too_many_covariates), 7u);
  const auto missions = harness.missions();
  EXPECT_EQ(missions[0].covariates.size(), signals::max_covariates);
  EXPECT_EQ(missions[0].sample_faults.at("too_many_covariates"), 7);
  harness.pipeline->publish();
  EXPECT_EQ(harness.fleet.find("nomad")->faults.at("too_many_covariates"), 7u);
}

TEST_F(PipelineTest, CovariatesContinueAfterARestart) {
  send(event(MissionPhase::started, 0));
  send(0, {{"cpu_load", 0.5}});
  send_range(0, 100);
  harness.pipeline->tick(start_us + 2'000'000);
  harness.restart();
  send(100, {{"cpu_load", 0.5}});  // as it was
  send_range(100, 200);
  send(200, {{"cpu_load", 0.75}});
  send_range(200, 301);
  send(event(MissionPhase::finished, 301));
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_EQ(changes(missions[0].key).size(), 2u);
  ASSERT_EQ(missions[0].covariates.size(), 1u);
  EXPECT_NEAR(missions[0].covariates[0].mean, (4 * 0.5 + 2.015 * 0.75) / 6.015, 1e-6);
}

TEST_F(PipelineTest, CovariatesAloneOpenNoMission) {
  for (int k = 0; k < 5; ++k) send(k, {{"load", 1.0 * k}});
  EXPECT_TRUE(harness.missions().empty());
  send(event(MissionPhase::started, 10));
  send_range(10, 20);
  for (int k = 0; k < 3000; ++k) send(20 + k, {{"load", 1.0 * k}});
  // Without a tick: accumulated changes are stored.
  EXPECT_GE(changes(harness.missions()[0].key).size(), 2048u);
  harness.pipeline->tick(start_us);
  EXPECT_EQ(
      harness.store->covariates(harness.missions()[0].key, {}, {.limit = 10'000, .cursor = {}})->items.size(),
      3001u);
}

TEST_F(PipelineTest, HeightDeterminesTheGrade) {
  robot::RobotModel robot = testing::nomad();
  robot.robot_id = "climber";
  robot.effects = {{"grade", {{"share", 1}}}};
  harness.add_robot(robot);
  const auto handle = [&](auto message, std::int64_t at_us) {
    harness.pipeline->handle({"climber", std::move(message), at_us});
  };
  handle(event(MissionPhase::started, 0), start_us);
  const double speed = 3 * robot.kinematics.wheel_radius_m, slope = 0.05;
  for (std::int64_t k = 0; k <= 1000; ++k) {  // 20 s up an even ramp, height ten times a second
    const double way = speed * 0.02 * static_cast<double>(k);
    const std::int64_t at_us = start_us + 20'000 * k;
    if (k % 5 == 0) handle(signals::CovariateMessage{at_us, {{"height_m", 100 + slope * way}}}, at_us);
    handle(sample(k), at_us);
  }
  handle(event(MissionPhase::finished, 1001), start_us + 20'020'000);
  const history::Mission mission = harness.missions().back();
  const double raised_j =
      robot.total_mass_kg(2) * robot::standard_gravity_m_s2 * slope * mission.accounts.distance_m;
  // Except for the interval until the climb is available.
  EXPECT_NEAR(mission.accounts.ledger[signals::Term::potential], raised_j, 0.08 * raised_j);
  EXPECT_NEAR(mission.accounts.ledger.total(), mission.accounts.battery_j, 1e-9 * 1000);
}

TEST_F(PipelineTest, TelemetryAloneOpensImplicitMission) {
  send_range(0, 100);
  harness.pipeline->finish();
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_TRUE(missions[0].implicit);
  EXPECT_EQ(missions[0].state, history::MissionState::finished);
}

TEST_F(PipelineTest, CountsDuplicatesLateAndMissing) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  send(sample(49));
  send(sample(52));  // 50, 51 missing
  send(sample(51));  // overtaken
  send_range(53, 100);
  send(event(MissionPhase::finished, 101));
  EXPECT_EQ(harness.faults(IngestFault::duplicate), 1u);
  EXPECT_EQ(harness.faults(IngestFault::missing), 1u);  // 51 was sorted in
  EXPECT_EQ(harness.faults(IngestFault::late), 0u);
  const auto mission = harness.missions().at(0);
  EXPECT_EQ(mission.samples, 99);
  EXPECT_EQ(mission.sample_faults.at("duplicate"), 1);
  EXPECT_EQ(mission.sample_faults.at("missing"), 1);
  EXPECT_NEAR(mission.accounts.measured_j, 48 * 99 * 0.02, 1e-6);
}

TEST_F(PipelineTest, RejectsInfiniteAndAbsurdValues) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  Sample infinite = sample(50);
  infinite.battery_current_a = INFINITY;
  send(infinite);
  Sample absurd = sample(51);
  absurd.wheel_velocity_rad_s[0] = 1e9;
  send(absurd);
  Sample blind = sample(52);
  blind.wheel_velocity_rad_s[1] = NAN;
  send(blind);
  send_range(53, 100);
  EXPECT_EQ(harness.faults(IngestFault::implausible), 3u);
  EXPECT_EQ(harness.faults(IngestFault::missing), 0u);
  send(event(MissionPhase::finished, 101));
  EXPECT_NEAR(harness.missions().at(0).accounts.measured_j, 48 * 99 * 0.02, 1e-6);
}

TEST_F(PipelineTest, ImplausibleSamplesHideNoLoss) {
  Sample absurd = sample(0);
  absurd.wheel_velocity_rad_s[0] = 1e9;
  send(absurd);
  send(event(MissionPhase::started, 1));
  send_range(1, 50);
  absurd.sequence = 50;
  send(absurd);
  send(absurd);
  send_range(54, 100);
  send_range(101, 200);
  EXPECT_EQ(harness.faults(IngestFault::implausible), 3u);
  EXPECT_EQ(harness.faults(IngestFault::missing), 3u + 1u);
}

TEST_F(PipelineTest, SilenceMakesTheMissionIncomplete) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  send_range(150, 200);
  send(event(MissionPhase::finished, 201));
  const auto mission = harness.missions().at(0);
  EXPECT_TRUE(mission.incomplete);
  EXPECT_EQ(mission.gap_count, 1);
  EXPECT_NEAR(mission.gap_s, 101 * 0.02, 1e-9);
  EXPECT_EQ(harness.faults(IngestFault::gap), 1u);
}

TEST_F(PipelineTest, BootedRobotContinuesItsMission) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  for (std::int64_t k = 0; k < 50; ++k) {
    Sample s = sample(60 + k);
    s.sequence = k;
    send(s);
  }
  send(event(MissionPhase::finished, 111));
  EXPECT_EQ(harness.faults(IngestFault::restart), 1u);
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_EQ(missions[0].samples, 100);
  EXPECT_FALSE(missions[0].incomplete);
}

TEST_F(PipelineTest, ClockStepMakesMissionIncomplete) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  for (std::int64_t k = 50; k < 100; ++k) {
    Sample s = sample(k);
    s.utime_us += 86'400'000'000;
    send(s);
  }
  EXPECT_EQ(harness.faults(IngestFault::clock_forward), 1u);
  harness.pipeline->suspend();
  const auto mission = harness.missions().at(0);
  EXPECT_TRUE(mission.incomplete);
  EXPECT_NEAR(mission.accounts.measured_j, 48 * 98 * 0.02, 1e-6);
}

TEST_F(PipelineTest, FutureStampsAreAccounted) {
  send(event(MissionPhase::started, 0));
  for (std::int64_t k = 0; k < 100; ++k)
    harness.pipeline->handle({"nomad", sample(k), sample(k).utime_us - (k < 60 ? 10'000'000 : 10'000'001)});
  send(event(MissionPhase::finished, 101));
  EXPECT_EQ(harness.faults(IngestFault::clock_ahead), 40u);
  const auto mission = harness.missions().at(0);
  EXPECT_EQ(mission.sample_faults.at("clock_ahead"), 40);
  EXPECT_EQ(mission.samples, 100);
  EXPECT_FALSE(mission.incomplete);
}

// Samples outside missions are not accounted for, but the fleet view shows the robot's present motion.
TEST(PipelineOutsideMissions, ShowsThePresentMotion) {
  ingest::SessionSettings settings;
  settings.implicit_missions = false;
  PipelineHarness harness(settings);
  harness.add_robot(testing::nomad());
  const auto send = [&](const auto& message) {
    harness.pipeline->handle({"nomad", message, message.utime_us});
  };
  send(event(MissionPhase::started, 0));
  std::int64_t k = 0;
  for (; k < 100; ++k) {
    Sample s = sample(k);
    s.wheel_velocity_rad_s = {5, 5};
    send(s);
  }
  send(event(MissionPhase::finished, k));
  harness.pipeline->tick(sample(k).utime_us);
  EXPECT_GT(harness.fleet.find("nomad")->speed_m_s, 0.1);
  for (; k < 200; ++k) {
    Sample s = sample(k);
    s.wheel_velocity_rad_s = {0, 0};
    s.battery_current_a = 0.25;
    send(s);
  }
  harness.pipeline->tick(sample(k).utime_us);
  const auto now = harness.fleet.find("nomad");
  EXPECT_EQ(now->speed_m_s, 0);
  EXPECT_EQ(now->sample.utime_us, sample(199).utime_us);
  EXPECT_DOUBLE_EQ(now->measured_power_w, 0.25 * now->sample.battery_voltage_v);
  EXPECT_TRUE(std::isnan(now->modelled_power_w));
  EXPECT_EQ(harness.missions().at(0).samples, 100);
}

TEST_F(PipelineTest, UnmeasuredChannelsAreNotZero) {
  send(event(MissionPhase::started, 0));
  for (std::int64_t k = 0; k < 100; ++k) {
    Sample s = sample(k);
    s.battery_current_a = signals::unmeasured;
    send(s);
  }
  send(event(MissionPhase::finished, 101));
  const auto mission = harness.missions().at(0);
  EXPECT_EQ(mission.accounts.measured_s, 0);
  EXPECT_GT(mission.accounts.modelled_j, 0);
  EXPECT_DOUBLE_EQ(mission.accounts.battery_j, mission.accounts.modelled_j);
}

// Modelled energy of one accelerating mission with a STARTED that declares `declared_kg` and samples with the
// payload `said_kg`.
struct Carried {
  double modelled_j = 0, shown_kg = 0, stored_kg = 0;
  std::uint64_t contradicted = 0;
};

Carried carried(double declared_kg, const std::function<double(std::int64_t)>& said_kg,
                std::int64_t kill_at = -1) {
  PipelineHarness harness;
  harness.add_robot(testing::nomad());
  // An earlier mission, which must have no influence.
  for (const double kg : {30.0, declared_kg}) {
    const std::int64_t from = kg == 30.0 ? -500 : 0;
    MissionEvent started = event(MissionPhase::started, from, "m" + std::to_string(from));
    started.payload_kg = kg;
    harness.pipeline->handle({"nomad", started, started.utime_us});
    for (std::int64_t k = from; k < from + 200; ++k) {
      Sample s = sample(k);
      s.sequence += 500;
      const double t_s = 0.02 * static_cast<double>(k - from);
      s.wheel_velocity_rad_s = {t_s, t_s};
      s.payload_kg = from < 0 ? 30 : said_kg(k);
      harness.pipeline->handle({"nomad", s, s.utime_us});
      if (k == kill_at) {
        harness.pipeline->tick(s.utime_us);
        harness.restart();
      }
    }
    harness.pipeline->suspend();
    if (from < 0) {
      const MissionEvent finished = event(MissionPhase::finished, -299, "m-500");
      harness.pipeline->handle({"nomad", finished, finished.utime_us});
    }
  }
  const history::Mission mission = harness.missions().at(1);
  const auto raw = harness.store->telemetry(mission.key, {}, {.limit = 1, .cursor = {}});
  return {mission.accounts.modelled_j, harness.fleet.find("nomad")->sample.payload_kg,
          raw->items.at(0).payload_kg, harness.faults(IngestFault::zero_payload)};
}

TEST(PipelinePayload, DefaultsToTheDeclaredLoad) {
  const auto always = [](double kg) { return [kg](std::int64_t) { return kg; }; };
  const Carried said = carried(20, always(20));
  const Carried silent = carried(20, always(signals::unmeasured));
  EXPECT_EQ(silent.modelled_j, said.modelled_j);
  EXPECT_EQ(silent.shown_kg, 20);
  EXPECT_TRUE(std::isnan(silent.stored_kg));  // evidence stays as it came
  EXPECT_EQ(silent.contradicted, 0u);

  const Carried empty = carried(signals::unmeasured, always(0));
  EXPECT_GT(said.modelled_j, empty.modelled_j + 1);
  EXPECT_EQ(carried(signals::unmeasured, always(signals::unmeasured)).modelled_j, empty.modelled_j);
  EXPECT_EQ(carried(0, always(0)).contradicted, 0u);
  EXPECT_EQ(carried(20, always(20), 100).contradicted, 0u);
}

TEST(PipelinePayload, ZeroBeforeLoadIsUnset) {
  const auto always = [](double kg) { return [kg](std::int64_t) { return kg; }; };
  const Carried unfilled = carried(20, always(0));
  EXPECT_EQ(unfilled.modelled_j, carried(20, always(20)).modelled_j);
  EXPECT_EQ(unfilled.contradicted, 200u);
  EXPECT_EQ(unfilled.stored_kg, 0);

  const auto set_down = [](std::int64_t k) { return k < 100 ? 20.0 : 0.0; };
  const Carried less = carried(20, set_down);
  EXPECT_LT(less.modelled_j, unfilled.modelled_j - 0.5);
  EXPECT_EQ(less.shown_kg, 0);
  EXPECT_EQ(less.contradicted, 0u);
  // A restarted service remembers whether a load was named.
  EXPECT_EQ(carried(20, set_down, 150).contradicted, 0u);
  EXPECT_EQ(carried(20, always(0), 150).contradicted, 200u);
}

TEST_F(PipelineTest, AbsurdPayloadIsDropped) {
  MissionEvent started = event(MissionPhase::started, 0);
  started.payload_kg = -1e300;
  send(started);
  MissionEvent timeless = event(MissionPhase::started, 0, "m0");
  timeless.utime_us = std::numeric_limits<std::int64_t>::min();
  harness.pipeline->handle({"nomad", timeless, start_us});
  send_range(0, 100);
  send(event(MissionPhase::finished, 101));
  EXPECT_EQ(harness.faults(IngestFault::implausible), 2u);
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_EQ(missions[0].mission_id, "m1");
  EXPECT_TRUE(std::isnan(missions[0].payload_kg));
  EXPECT_EQ(missions[0].samples, 100);
}

TEST_F(PipelineTest, CountsRobotsWithoutModel) {
  harness.pipeline->handle({"stranger", sample(0), start_us});
  harness.pipeline->publish();
  EXPECT_EQ(harness.faults(IngestFault::unknown_robot), 1u);
  const auto snapshot = harness.fleet.find("stranger");
  ASSERT_NE(snapshot, nullptr);
  EXPECT_FALSE(snapshot->has_model);
  EXPECT_TRUE(harness.missions().empty());
}

TEST_F(PipelineTest, MarksUnfinishedMissions) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  harness.pipeline->finish();
  const auto mission = harness.missions().at(0);
  EXPECT_EQ(mission.state, history::MissionState::unfinished);
  EXPECT_TRUE(mission.incomplete);
  EXPECT_EQ(harness.counters.missions_started[0], 1u);
  EXPECT_EQ(harness.counters.missions_ended[static_cast<std::size_t>(history::MissionState::unfinished)], 1u);
}

TEST_F(PipelineTest, StartSupersedesTheOpenMission) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  send(event(MissionPhase::started, 50, "m2"));
  send_range(50, 100);
  send(event(MissionPhase::finished, 101, "m2"));
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 2u);
  EXPECT_EQ(missions[0].state, history::MissionState::superseded);
  EXPECT_EQ(missions[1].state, history::MissionState::finished);
}

TEST_F(PipelineTest, ReusedIdIsAnotherMission) {
  const auto run = [&](std::int64_t from) {
    send(event(MissionPhase::started, from, "1"));
    send(event(MissionPhase::started, from, "1"));  // resent
    for (std::int64_t k = 0; k <= 100; ++k) {
      Sample s = sample(from + k);
      s.sequence = k;  // the robot has booted
      send(s);
    }
    send(event(MissionPhase::finished, from + 101, "1"));
  };
  run(0);
  run(1000);
  harness.restart();  // earlier missions are read from the store
  run(2000);
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 3u);
  for (const history::Mission& mission : missions) {
    EXPECT_EQ(mission.mission_id, "1");
    EXPECT_EQ(mission.state, history::MissionState::finished);
    EXPECT_EQ(mission.samples, 101);
    EXPECT_EQ(mission.sample_faults.count("reused_mission_id"), 0u);
    EXPECT_NEAR(mission.accounts.measured_j, 48 * 2.0, 1e-6);
  }
  EXPECT_EQ(harness.faults(IngestFault::reused_mission_id), 2u);
  EXPECT_EQ(harness.faults(IngestFault::duplicate), 3u);
  EXPECT_EQ(harness.faults(IngestFault::bad_event), 0u);
  const auto events = harness.store->events(0, 100);
  ASSERT_TRUE(events);
  std::vector<std::string> told;
  for (const history::Event& e : *events)
    if (e.kind == "mission_id_reused") told.push_back(e.detail_json);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[1], "{\"earlier_mission\":" + std::to_string(missions[1].key) + ",\"mission\":" +
                         std::to_string(missions[2].key) + ",\"mission_id\":\"1\",\"start_utime_us\":" +
                         std::to_string(missions[2].start_utime_us) + "}");
}

TEST_F(PipelineTest, MissionContinuesAfterAKill) {
  send(event(MissionPhase::started, 0));
  send_range(0, 100);
  harness.pipeline->tick(start_us + 2'000'000);
  harness.restart();
  send_range(120, 200);
  send(event(MissionPhase::finished, 201));
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_EQ(missions[0].state, history::MissionState::finished);
  EXPECT_GE(missions[0].samples, 175);
  EXPECT_FALSE(missions[0].incomplete);
  EXPECT_NEAR(missions[0].accounts.measured_j, 48 * 199 * 0.02, 1e-6) << "0.4 s without samples are bridged";
}

TEST_F(PipelineTest, EndAfterAKillIsKept) {
  send(event(MissionPhase::started, 0));
  send_range(0, 100);
  harness.pipeline->tick(start_us + 2'000'000);
  harness.restart();
  send(event(MissionPhase::finished, 101));
  const auto mission = harness.missions().at(0);
  EXPECT_EQ(mission.state, history::MissionState::finished);
  EXPECT_FALSE(mission.incomplete) << mission.incomplete_reason;
  EXPECT_EQ(mission.samples, 100);
}

TEST_F(PipelineTest, HostClockStepIsNoSilence) {
  send(event(MissionPhase::started, 0));
  send_range(0, 100);
  const std::int64_t hour_us = 3'600'000'000, now_us = start_us + 2'000'000;
  harness.pipeline->tick(now_us);
  const auto received = [&] { return harness.fleet.all().at(0)->received_utime_us; };
  const std::int64_t before_us = received();
  harness.pipeline->on_host_clock_step(now_us + hour_us, hour_us);
  harness.pipeline->tick(now_us + hour_us);
  EXPECT_EQ(received(), before_us + hour_us);
  EXPECT_EQ(harness.missions().at(0).state, history::MissionState::open);
  // A message received after the step is stamped in the new time already.
  harness.pipeline->on_host_clock_step(now_us + hour_us, hour_us);
  harness.pipeline->publish();
  EXPECT_EQ(received(), before_us + hour_us);
}

TEST_F(PipelineTest, LostRobotsMissionIsInterrupted) {
  send(event(MissionPhase::started, 0));
  send_range(0, 100);
  harness.pipeline->tick(start_us + 2'000'000);
  harness.restart();
  harness.pipeline->tick(start_us + 3'000'000);
  harness.pipeline->finish();
  const auto mission = harness.missions().at(0);
  EXPECT_EQ(mission.state, history::MissionState::interrupted);
  EXPECT_TRUE(mission.incomplete);
  EXPECT_GT(mission.accounts.measured_j, 0);
}

robot::RobotModel thirstier() {
  robot::RobotModel robot = testing::nomad();
  robot.idle_power_w += 10;
  return robot;
}

TEST_F(PipelineTest, DeclaredMissionKeepsItsModel) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  harness.add_version(thirstier(), 2);
  send_range(50, 101);
  send(event(MissionPhase::finished, 102));
  send(event(MissionPhase::started, 110, "m2"));
  send_range(110, 211);
  send(event(MissionPhase::finished, 212, "m2"));
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 2u);
  EXPECT_EQ(missions[0].model_version, 1);
  EXPECT_EQ(missions[1].model_version, 2);
  EXPECT_NEAR(missions[1].accounts.modelled_j - missions[0].accounts.modelled_j, 10 * 2.0, 1e-6);
}

TEST_F(PipelineTest, RestartKeepsTheMissionsModel) {
  send(event(MissionPhase::started, 0));
  send_range(0, 50);
  harness.pipeline->tick(start_us);
  harness.add_version(thirstier(), 2);
  harness.restart();
  send_range(50, 101);
  send(event(MissionPhase::finished, 102));
  const auto mission = harness.missions().at(0);
  EXPECT_EQ(mission.model_version, 1);
  const double per_s = mission.accounts.ledger[signals::Term::accessories] / mission.accounts.duration_s;
  EXPECT_NEAR(per_s, testing::nomad().idle_power_w, 1e-9);
  EXPECT_TRUE(harness.warnings.empty());
}

TEST_F(PipelineTest, UndeclaredMissionChangesModelImmediately) {
  send_range(0, 51);
  harness.add_version(thirstier(), 2);
  send_range(51, 101);
  harness.pipeline->finish();
  const auto mission = harness.missions().at(0);
  EXPECT_TRUE(mission.implicit);
  EXPECT_EQ(mission.model_version, 2);
  EXPECT_GT(mission.accounts.ledger[signals::Term::accessories] / mission.accounts.duration_s,
            testing::nomad().idle_power_w + 4);
}

TEST_F(PipelineTest, SameMessagesGiveSameBits) {
  const auto run = [] {
    PipelineHarness h;
    h.add_robot(testing::nomad());
    h.pipeline->handle({"nomad", event(MissionPhase::started, 0), 0});
    for (std::int64_t k = 0; k < 3000; ++k) {
      Sample s = sample(k, 40 + 10 * std::sin(0.01 * static_cast<double>(k)));
      s.wheel_velocity_rad_s = {3 + std::sin(0.02 * static_cast<double>(k)), 3};
      h.pipeline->handle({"nomad", s, 0});
    }
    h.pipeline->handle({"nomad", event(MissionPhase::finished, 3001), 0});
    return h.missions().at(0).accounts;
  };
  const signals::Accounts a = run(), b = run();
  EXPECT_EQ(std::bit_cast<std::uint64_t>(a.measured_j), std::bit_cast<std::uint64_t>(b.measured_j));
  EXPECT_EQ(std::bit_cast<std::uint64_t>(a.modelled_j), std::bit_cast<std::uint64_t>(b.modelled_j));
}

// A mission of 301 samples, stamped by a clock that is off.
struct LoggedMission {
  std::string id;
  std::int64_t first_sequence = 0, clock_us = 0;
};

class ClockTest : public PipelineTest {
 protected:
  void play(const LoggedMission& mission, bool announced = true) {
    const auto shifted = [&](auto message) {
      message.utime_us += mission.clock_us;
      return message;
    };
    if (announced) send(shifted(event(MissionPhase::started, mission.first_sequence, mission.id)));
    for (std::int64_t k = 0; k <= 300; ++k) send(shifted(sample(mission.first_sequence + k)));
    if (announced) send(shifted(event(MissionPhase::finished, mission.first_sequence + 302, mission.id)));
  }
  void expect_sound(std::size_t count) {
    const auto missions = harness.missions();
    ASSERT_EQ(missions.size(), count);
    for (const history::Mission& mission : missions) {
      EXPECT_EQ(mission.samples, 301) << mission.mission_id;
      EXPECT_NEAR(mission.accounts.measured_j, 48 * 6, 1e-6) << mission.mission_id;
      EXPECT_FALSE(mission.incomplete) << mission.mission_id;
      EXPECT_EQ(mission.findings_json.find("clock"), std::string::npos) << mission.findings_json;
      EXPECT_FALSE(mission.sample_faults.contains("clock_backward"));
      EXPECT_FALSE(mission.sample_faults.contains("clock_forward"));
    }
    EXPECT_EQ(harness.counters.missions_left_out[0], 0u);
    EXPECT_EQ(harness.faults(IngestFault::outside_mission), 0u);
  }
};

constexpr std::int64_t hour_us = 3'600'000'000;

TEST_F(ClockTest, StepBetweenMissionsBlamesNeither) {
  play({"m1"});
  play({"m2", 400, -hour_us / 4});
  play({"m3", 800, 3 * hour_us});
  harness.pipeline->finish();
  expect_sound(3);
}

TEST_F(ClockTest, OlderLogsFollowNewerOnes) {
  play({"new"});
  play({"old", 0, -48 * hour_us});
  play({"older", 0, -96 * hour_us});
  harness.pipeline->finish();
  expect_sound(3);
}

TEST_F(ClockTest, DoubledLogCountsOnce) {
  play({"m1"});
  play({"m1"});
  harness.pipeline->finish();
  ASSERT_EQ(harness.missions().size(), 1u);
  EXPECT_NEAR(harness.missions()[0].accounts.measured_j, 48 * 6, 1e-6);
}

TEST_F(ClockTest, RestartedClockBeginsImplicitMission) {
  play({"", 0, 0}, false);
  play({"", 0, 0}, false);
  play({"", 5'000, -hour_us}, false);
  harness.pipeline->finish();
  expect_sound(3);
}

TEST_F(ClockTest, StepWithinMissionIsNamed) {
  send(event(MissionPhase::started, 0));
  send_range(0, 200);
  for (std::int64_t k = 200; k < 400; ++k) {
    Sample s = sample(k);
    s.utime_us -= hour_us / 4;
    send(s);
  }
  harness.pipeline->finish();
  EXPECT_EQ(harness.counters.contradictions[static_cast<std::size_t>(ContradictionKind::clock)], 1u);
}

// 2 of 10 s have readings that the pack cannot have; the reference is the mean of the rest.
TEST_F(PipelineTest, ImpossibleReadingsAreNotMeasured) {
  for (const auto& [volts, amperes] :
       {std::pair{0.0, 0.0}, {65.535, -0.01}, {12.1, 2.0}, {48.4, 2.0}, {3.3, 2.0}}) {
    PipelineHarness one;
    one.add_robot(testing::nomad());
    for (std::int64_t k = 0; k <= 500; ++k) {
      Sample s = sample(k);
      if (k >= 200 && k < 300) {
        s.battery_voltage_v = volts;
        s.battery_current_a = amperes;
      }
      one.pipeline->handle({"nomad", s, s.utime_us});
    }
    one.pipeline->finish();
    const auto missions = one.missions();
    ASSERT_EQ(missions.size(), 1u);
    EXPECT_NEAR(missions[0].accounts.measured_s, 8 - 0.02, 0.021) << volts;
    EXPECT_NEAR(missions[0].accounts.measured_j, 48 * missions[0].accounts.measured_s, 1e-6) << volts;
    EXPECT_EQ(missions[0].sample_faults.at("impossible"), 100) << volts;
    EXPECT_GT(one.counters.contradictions[static_cast<std::size_t>(ContradictionKind::implausible)], 0u)
        << volts;
  }
}

// From 4 s to 8 s the last row repeats; its first second is booked.
TEST_F(PipelineTest, FrozenStreamIsNotBooked) {
  PipelineHarness one;
  one.add_robot(testing::nomad());
  for (std::int64_t k = 0; k <= 500; ++k) {
    Sample s = sample(k);
    s.battery_current_a += 0.01 * static_cast<double>(k < 200 || k >= 400 ? k % 2 : 1);
    one.pipeline->handle({"nomad", s, s.utime_us});
  }
  one.pipeline->finish();
  const auto missions = one.missions();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_NEAR(missions[0].accounts.measured_s, 7, 0.1);
  EXPECT_NEAR(static_cast<double>(missions[0].sample_faults.at("impossible")), 150, 3);
}

TEST_F(PipelineTest, ChargeBeginsWithPossibleReading) {
  robot::RobotModel robot = testing::nomad();
  robot.robot_id = "plain";
  robot.battery.open_circuit_voltage.clear();
  const auto charge_after = [&](double first_v, std::int64_t count, std::int64_t samples) {
    PipelineHarness one;
    one.add_robot(robot);
    for (std::int64_t k = 0; k < samples; ++k) {
      Sample s = sample(k);
      s.utime_us = start_us + k * 100'000;
      s.wheel_velocity_rad_s = {0, 0};  // constant readings of a robot that drives are contradicted
      if (k < count) s.battery_voltage_v = first_v;
      one.pipeline->handle({"plain", s, s.utime_us});
    }
    one.pipeline->finish();
    return one.fleet.find("plain")->state_of_charge;
  };
  const double truth = charge_after(24, 0, 1'200);
  ASSERT_TRUE(std::isfinite(truth));
  EXPECT_TRUE(std::isnan(charge_after(0, 1, 1)));
  for (const double first_v : {0.0, 52.0, 65.5})
    EXPECT_NEAR(charge_after(first_v, 1, 1'200), truth, 0.02) << first_v;
  // Possible, and yet not the pack's: revised by the readings that follow.
  for (const double first_v : {18.0, 22.0, 27.5})
    EXPECT_NEAR(charge_after(first_v, 15, 1'200), truth, 0.03) << first_v;
}

// Of a queue that fills and empties again: events are queued as long as there is room, samples more rarely.
TEST(Thinning, LeavesRoomForEvents) {
  constexpr std::size_t capacity = 1000;
  EXPECT_EQ(thinning(0, capacity), 1);
  EXPECT_EQ(thinning(499, capacity), 1);
  EXPECT_EQ(thinning(500, capacity), 2);
  EXPECT_EQ(thinning(750, capacity), 4);
  EXPECT_EQ(thinning(capacity, capacity), 512);
  const InboundMessage start{"nomad", event(MissionPhase::started, 0), start_us};
  std::size_t queued = 0;
  for (std::int64_t k = 0; k < 100'000; ++k)
    queued += is_chosen({"nomad", sample(k), start_us}, thinning(queued, capacity)) ? 1 : 0;
  EXPECT_GT(queued, capacity * 9 / 10);
  EXPECT_LT(queued, capacity * 97 / 100);
  EXPECT_TRUE(is_chosen(start, thinning(capacity - 1, capacity)));
}

// Power and speed that vary within seconds; energies as of the trapezoidal rule over the samples that are
// left.
TEST_F(PipelineTest, ThinnedMissionsKeepTheirEnergy) {
  constexpr std::int64_t last = 6000;
  const auto power_w = [](std::int64_t k) { return 48 + 20 * std::sin(0.02 * static_cast<double>(k)); };
  const auto drive = [&](std::int64_t one_of, const std::string& id, std::int64_t begin) {
    send(event(MissionPhase::started, begin, id));
    for (std::int64_t k = begin; k <= begin + last; ++k) {
      const InboundMessage message{"nomad", sample(k, power_w(k)), start_us + k * 20'000, {}, one_of};
      if (is_chosen(message, one_of)) harness.pipeline->handle(message);
    }
    send(event(MissionPhase::finished, begin + last + 1, id));
    for (std::int64_t k = begin + last + 2; k < begin + 8000; ++k)
      harness.pipeline->handle({"nomad", sample(k, power_w(k)), start_us + k * 20'000});
  };
  for (const std::int64_t one_of : {1, 2, 4, 8, 16}) {
    const std::int64_t begin = 8000 * std::bit_width(static_cast<std::uint64_t>(one_of));
    drive(one_of, "of " + std::to_string(one_of), begin);
    const auto missions = harness.missions();
    const auto found =
        std::ranges::find(missions, "of " + std::to_string(one_of), &history::Mission::mission_id);
    ASSERT_NE(found, missions.end());
    const history::Mission& mission = *found;
    ASSERT_EQ(mission.state, history::MissionState::finished);
    double expected_j = 0, bound_j = 0;
    for (std::int64_t k = begin; k < begin + last; ++k) {
      expected_j += 0.02 * 0.5 * (power_w(k) + power_w(k + 1));
      bound_j += 0.02 * 20 * 0.02 * 0.02 * static_cast<double>(one_of * one_of) / 8;  // |P''| step^2 / 8
    }
    EXPECT_NEAR(mission.accounts.measured_j, expected_j, bound_j + 0.02 * static_cast<double>(one_of) * 70)
        << one_of;
    const auto left_out = mission.sample_faults.find("queue_full");
    const std::int64_t taken = last / one_of + 1;
    EXPECT_EQ(left_out == mission.sample_faults.end() ? 0 : left_out->second, (taken - 1) * (one_of - 1));
    EXPECT_FALSE(mission.sample_faults.contains("missing"));
    EXPECT_FALSE(mission.sample_faults.contains("gap"));
  }
}

}  // namespace
}  // namespace joulecast::ingest
