// The practice logs: recordings of another implementation of the contract and of another plant, with the true
// effects.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "gap/diagnose/recordings.h"
#include "plausibility/check.h"
#include "robot/robot_file.h"
#include "telemetry/codec.h"
#include "telemetry/event_log.h"
#include "telemetry/log_recordings.h"
#include "telemetry/mission_tracker.h"
#include "telemetry/sequence_tracker.h"
#include "telemetry/validation.h"
#include "tests/ingest/harness.h"
#include "tests/support/shared_folder.h"

namespace joulecast {
namespace {

namespace fs = std::filesystem;

const fs::path practice = fs::path(JOULECAST_SHARED) / "data" / "practice";
constexpr std::array logs{"01_load_rolling", "02_scrub", "03_no_regeneration", "04_accessory", "05_zone",
                          "06_two",          "07_none",  "08_outside"};

class PracticeLog : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    folder_ = practice / GetParam();
    JOULECAST_NEED_SHARED(fs::exists(folder_), "practice log " << folder_);
    log_ = folder_ / "telemetry.lcmlog";
    std::ifstream truth(folder_ / "truth.json");
    truth_ = nlohmann::json::parse(truth);
    const auto robot = robot::load_robot(folder_ / "robot.json");
    ASSERT_TRUE(robot) << describe(robot.error());
    robot_ = *robot;
  }

  void each_event(const std::function<void(const telemetry::LogEvent&)>& handle) const {
    auto reader = telemetry::EventLogReader::open(log_);
    ASSERT_TRUE(reader);
    telemetry::LogRead read = reader->next();
    for (; read.status == telemetry::LogStatus::event; read = reader->next()) {
      handle(read.event);
      if (HasFatalFailure()) return;
    }
    EXPECT_EQ(read.status, telemetry::LogStatus::end) << read.message;
  }

  fs::path folder_;
  std::string log_;
  nlohmann::json truth_;
  robot::RobotModel robot_;
};

INSTANTIATE_TEST_SUITE_P(All, PracticeLog, ::testing::ValuesIn(logs),
                         [](const auto& log) { return std::string(log.param).substr(3); });

TEST(PracticeLogs, AreAllTested) {
  JOULECAST_NEED_SHARED(fs::exists(practice), "practice logs");
  const auto is_log = [](const auto& entry) { return fs::exists(entry.path() / "telemetry.lcmlog"); };
  EXPECT_EQ(std::ranges::count_if(fs::directory_iterator(practice), is_log),
            static_cast<std::ptrdiff_t>(logs.size()));
}

TEST_P(PracticeLog, ReadsRobotFileUnchanged) {
  std::ifstream file(folder_ / "robot.json");
  EXPECT_EQ(robot::robot_to_json(robot_), nlohmann::json::parse(file));
}

// Messages pass validation, re-encode to the same bytes, and split into the missions that were driven. Equal
// bytes imply equal fingerprints.
TEST_P(PracticeLog, ReencodesToSameBytes) {
  using namespace telemetry;
  SequenceTracker sequence;
  MissionTracker missions;
  std::size_t finished = 0;
  std::uint64_t samples = 0;
  each_event([&](const LogEvent& message) {
    const auto channel = parse_channel(message.channel);
    ASSERT_TRUE(channel);
    const std::vector<std::uint8_t> bytes(message.data.begin(), message.data.end());
    if (channel->subject == Subject::mission_event) {
      const auto event = decode_mission_event(bytes);
      ASSERT_TRUE(event) << describe(event.error());
      ASSERT_EQ(event->robot_id, channel->robot_id);
      ASSERT_EQ(encode_mission_event(event->robot_id, event->event).value(), bytes);
      for (const MissionAction& action : missions.on_event(event->event)) {
        if (action.kind != MissionAction::Kind::close || action.implicit) continue;
        ASSERT_EQ(action.end, MissionEnd::finished);
        ++finished;
      }
      return;
    }
    const auto sample = decode_telemetry(bytes);
    ASSERT_TRUE(sample) << describe(sample.error());
    ASSERT_EQ(sample->robot_id, channel->robot_id);
    ASSERT_EQ(encode_telemetry(sample->robot_id, sample->sample).value(), bytes);
    const auto fault = check_plausible(sample->sample);
    ASSERT_FALSE(fault) << describe(*fault);
    const Placement placement = sequence.place(sample->sample.sequence, sample->sample.utime_us);
    if (placement.advances()) missions.on_sample(sample->sample.utime_us, sample->sample.payload_kg);
    ++samples;
  });
  EXPECT_EQ(finished, truth_["missions"].get<std::size_t>());
  EXPECT_EQ(sequence.counters().received, samples);
  EXPECT_EQ(sequence.counters().fresh, samples);
  EXPECT_EQ(missions.counters().unknown_missions, 0u);
}

// Energies are compared with the trapezoid rule on V i of the raw samples between a mission's events, which
// shares no code with the meter.
TEST_P(PracticeLog, EnergyMatchesIndependentQuadrature) {
  testing::PipelineHarness harness;
  harness.add_robot(robot_);
  std::map<std::string, double> expected;
  std::string mission;
  double last_t = 0, last_p = 0;
  bool any = false;
  each_event([&](const telemetry::LogEvent& event) {
    const auto message =
        ingest::decode_message(event.channel, event.data, event.timestamp_us, harness.counters);
    ASSERT_TRUE(message);
    harness.pipeline->handle(*message);
    if (event.channel.starts_with("MISSION_EVENT")) {
      const auto decoded = telemetry::decode_mission_event(event.data);
      mission = decoded->event.phase == signals::MissionPhase::started ? decoded->event.mission_id : "";
      any = false;
    } else if (!mission.empty()) {
      const auto decoded = telemetry::decode_telemetry(event.data);
      const double t = static_cast<double>(decoded->sample.utime_us) * 1e-6;
      const double p = decoded->sample.battery_voltage_v * decoded->sample.battery_current_a;
      if (any) expected[mission] += 0.5 * (t - last_t) * (p + last_p);
      last_t = t;
      last_p = p;
      any = true;
    }
  });
  harness.pipeline->finish();
  const auto missions = harness.missions();
  EXPECT_EQ(missions.size(), expected.size());
  for (const history::Mission& m : missions) {
    SCOPED_TRACE(m.mission_id);
    EXPECT_EQ(m.state, history::MissionState::finished);
    EXPECT_FALSE(m.incomplete);
    EXPECT_NEAR(m.accounts.measured_j, expected.at(m.mission_id), 1e-3 * expected.at(m.mission_id));
    EXPECT_NEAR(m.accounts.ledger.total(), m.accounts.battery_j, 1e-9 * m.accounts.battery_j);
  }
  for (const auto& fault : harness.counters.faults) EXPECT_EQ(fault.load(), 0u);
  for (const auto& contradictions : harness.counters.contradictions) EXPECT_EQ(contradictions.load(), 0u);
}

TEST_P(PracticeLog, IsNotContradicted) {
  const auto checks = plausibility::check_recordings(*telemetry::load_recordings({&log_, 1}), robot_);
  EXPECT_TRUE(std::ranges::none_of(checks, &plausibility::Check::contradicted));
  EXPECT_LE(checks.size(), 1u);
}

std::string answer_of(const gap::Diagnosis& d) {
  std::ostringstream text;
  text << name_of(d.verdict) << ", gap " << d.power_absolute_relative << " over noise " << d.noise_floor;
  for (const gap::DiagnosedEffect& e : d.effects) {
    text << "; " << e.id;
    for (const gap::DiagnosedParameter& p : e.parameters)
      text << " " << p.name << " " << p.value << " +- " << p.deviation;
    text << ", probability " << e.probability << " (group " << e.group << "), " << e.power_w << " W";
  }
  return text.str();
}

TEST_P(PracticeLog, ReturnsRightVerdict) {
  const auto recordings = telemetry::load_recordings({&log_, 1});
  ASSERT_TRUE(recordings);
  const auto diagnosis = gap::diagnose(*recordings, robot_);
  ASSERT_TRUE(diagnosis);
  SCOPED_TRACE(answer_of(*diagnosis));

  std::map<std::string, double> strengths = truth_["effects"];
  EXPECT_EQ(diagnosis->motor_channels, truth_["motor_channels"].get<bool>());
  if (strengths.empty()) {
    EXPECT_EQ(name_of(diagnosis->verdict), "none");
    return;
  }
  if (strengths.begin()->first.starts_with("x_")) {
    EXPECT_EQ(name_of(diagnosis->verdict), "outside");
    return;
  }
  EXPECT_EQ(name_of(diagnosis->verdict), "effects");
  ASSERT_EQ(diagnosis->effects.size(), strengths.size());
  for (const gap::DiagnosedEffect& effect : diagnosis->effects) {
    const auto planted = strengths.find(effect.id);
    ASSERT_NE(planted, strengths.end()) << effect.id << " is not there, or named twice";
    EXPECT_NEAR(effect.parameters.front().value, planted->second, 0.1 * planted->second) << effect.id;
    // A constant load and a current sensor's offset cannot be distinguished in these recordings.
    const bool constant_load = effect.id == "accessory_load";
    EXPECT_EQ(effect.alternatives,
              constant_load ? std::vector<std::string>{"current_sensor_bias"} : std::vector<std::string>{});
    strengths.erase(planted);
  }
  // The effects explain most of the error above noise and sampling.
  ASSERT_TRUE(diagnosis->shrinkage);
  EXPECT_GT(diagnosis->shrinkage->interval[0], 0.5);
}

}  // namespace
}  // namespace joulecast
