// Recorded logs through the whole pipeline, against an energy computed without it.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <vector>

#include "robot/robot_file.h"
#include "signals/mission_event.h"
#include "telemetry/event_log.h"
#include "tests/ingest/harness.h"
#include "tests/support/shared_folder.h"

namespace joulecast::ingest {
namespace {

namespace fs = std::filesystem;

// Trapezoid rule on V i of the raw samples between a mission's events: shares nothing with the meter.
std::map<std::string, double> independent_energies(const std::string& log) {
  std::map<std::string, double> energy;
  auto reader = telemetry::EventLogReader::open(log);
  std::string mission;
  double last_t = 0, last_p = 0;
  bool any = false;
  for (telemetry::LogRead read = reader->next(); read.status == telemetry::LogStatus::event;
       read = reader->next()) {
    if (read.event.channel.starts_with("MISSION_EVENT")) {
      const auto decoded = telemetry::decode_mission_event(read.event.data);
      mission = decoded->event.phase == signals::MissionPhase::started ? decoded->event.mission_id : "";
      any = false;
    } else if (!mission.empty()) {
      const auto decoded = telemetry::decode_telemetry(read.event.data);
      const double t = static_cast<double>(decoded->sample.utime_us) * 1e-6;
      const double p = decoded->sample.battery_voltage_v * decoded->sample.battery_current_a;
      if (any) energy[mission] += 0.5 * (t - last_t) * (p + last_p);
      last_t = t;
      last_p = p;
      any = true;
    }
  }
  return energy;
}

TEST(PracticeLogs, MeasuredEnergyAgreesWithAnIndependentQuadrature) {
  const fs::path folder = fs::path(JOULECAST_SHARED) / "data" / "practice";
  JOULECAST_NEED_SHARED(fs::exists(folder), "practice logs");
  std::size_t logs = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (!entry.is_directory()) continue;
    ++logs;
    const std::string log = (entry.path() / "telemetry.lcmlog").string();
    testing::PipelineHarness harness;
    const auto robot = robot::load_robot((entry.path() / "robot.json").string());
    ASSERT_TRUE(robot) << describe(robot.error());
    harness.add_robot(*robot);
    auto reader = telemetry::EventLogReader::open(log);
    ASSERT_TRUE(reader);
    telemetry::LogRead read = reader->next();
    for (; read.status == telemetry::LogStatus::event; read = reader->next()) {
      const auto message =
          decode_message(read.event.channel, read.event.data, read.event.timestamp_us, harness.counters);
      ASSERT_TRUE(message);
      harness.pipeline->handle(*message);
    }
    ASSERT_EQ(read.status, telemetry::LogStatus::end);
    harness.pipeline->finish();
    const auto missions = harness.missions();
    const auto expected = independent_energies(log);
    EXPECT_EQ(missions.size(), expected.size()) << entry.path();
    for (const history::Mission& m : missions) {
      SCOPED_TRACE(m.mission_id);
      EXPECT_EQ(m.state, history::MissionState::finished);
      EXPECT_FALSE(m.incomplete);
      EXPECT_NEAR(m.accounts.measured_j, expected.at(m.mission_id), 1e-3 * expected.at(m.mission_id));
      EXPECT_NEAR(m.accounts.ledger.total(), m.accounts.battery_j, 1e-9 * m.accounts.battery_j);
    }
    for (const auto& fault : harness.counters.faults) EXPECT_EQ(fault.load(), 0u) << entry.path();
    for (const auto& told : harness.counters.contradictions) EXPECT_EQ(told.load(), 0u) << entry.path();
  }
  EXPECT_GT(logs, 0u);
}

}  // namespace
}  // namespace joulecast::ingest
