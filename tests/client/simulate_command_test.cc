#include <gtest/gtest.h>
#include <re2/re2.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/host_clock.h"
#include "client/commands/table.h"
#include "signals/sample.h"
#include "telemetry/codec.h"
#include "telemetry/event_log.h"

namespace joulecast::client {
namespace {

namespace fs = std::filesystem;

// The exit code of a command line; empty when it does not parse.
std::optional<Exit> run(std::vector<std::string> words) {
  CLI::App program("joulecast");
  program.require_subcommand(1);
  Exit exit = Exit::ok;
  add_commands(program, exit);
  std::reverse(words.begin(), words.end());
  try {
    program.parse(words);
  } catch (const CLI::ParseError&) {
    return std::nullopt;
  }
  return exit;
}

class SimulateCommand : public ::testing::Test {
 protected:
  SimulateCommand() {
    std::string name = (fs::temp_directory_path() / "joulecast-simulate-XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~SimulateCommand() override { fs::remove_all(folder_); }

  std::string file(const char* name) const { return (folder_ / name).string(); }
  static std::string text_of(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }

  fs::path folder_;
};

TEST_F(SimulateCommand, WritesLogAndSealedTruth) {
  ASSERT_EQ(run({"simulate", "--quiet", "--robots", "4", "--missions", "1", "--seed", "9", "--log",
                 file("a.lcmlog"), "--truth", file("truth.json"), "--effect", "coulomb_friction=0.25"}),
            Exit::ok);
  auto reader = telemetry::EventLogReader::open(file("a.lcmlog"));
  ASSERT_TRUE(reader);
  std::set<std::string> robots;
  std::size_t samples = 0;
  std::size_t events = 0;
  telemetry::LogRead read;
  while ((read = reader->next()).status == telemetry::LogStatus::event) {
    const auto channel = telemetry::parse_channel(read.event.channel);
    ASSERT_TRUE(channel);
    robots.emplace(channel->robot_id);
    if (channel->subject == telemetry::Subject::telemetry) {
      const auto decoded = telemetry::decode_telemetry(read.event.data);
      ASSERT_TRUE(decoded);
      ASSERT_EQ(decoded->robot_id, channel->robot_id);
      ASSERT_EQ(decoded->sample.utime_us, read.event.timestamp_us);
      ++samples;
    } else {
      ASSERT_TRUE(telemetry::decode_mission_event(read.event.data));
      ++events;
    }
  }
  EXPECT_EQ(read.status, telemetry::LogStatus::end);
  EXPECT_EQ(robots, (std::set<std::string>{"amr-01", "nomad-02", "tug-03", "p3dx-04"}));
  EXPECT_EQ(events, 8u);
  EXPECT_GT(samples, 4u * 50 * 100);

  const auto truth = nlohmann::json::parse(text_of(file("truth.json")));
  ASSERT_EQ(truth["robots"].size(), 4u);
  EXPECT_EQ(truth["robots"][2]["effects"]["coulomb_friction"], 0.25);
  EXPECT_GT(truth["robots"][0]["missions"][0]["battery_energy_j"], 0);
}

TEST_F(SimulateCommand, RepeatsBitForBit) {
  for (const char* name : {"a.lcmlog", "b.lcmlog"}) {
    ASSERT_EQ(run({"simulate", "--quiet", "--robots", "2", "--duration", "30", "--log", file(name)}),
              Exit::ok);
  }
  EXPECT_EQ(text_of(file("a.lcmlog")), text_of(file("b.lcmlog")));
}

struct Told {
  std::vector<signals::MissionEvent> missions;
  std::int64_t first_utime_us = 0, last_utime_us = 0;
};

Told told_by(const std::string& path) {
  Told told;
  auto reader = telemetry::EventLogReader::open(path);
  if (!reader) return told;
  telemetry::LogRead read;
  while ((read = reader->next()).status == telemetry::LogStatus::event) {
    if (told.first_utime_us == 0) told.first_utime_us = read.event.timestamp_us;
    told.last_utime_us = read.event.timestamp_us;
    if (auto event = telemetry::decode_mission_event(read.event.data)) told.missions.push_back(event->event);
  }
  return told;
}

TEST_F(SimulateCommand, RunsHaveDifferentMissionIds) {
  const auto first_id = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"simulate", "--quiet", "--robots",       "1",      "--duration",
                                   "0.1",      "--log",   file("a.lcmlog"), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_EQ(run(words), Exit::ok);
    const Told told = told_by(file("a.lcmlog"));
    return told.missions.empty() ? "" : told.missions.front().mission_id;
  };
  EXPECT_EQ(first_id({"--seed", "7"}), "amr-01-s7-m1");
  EXPECT_EQ(first_id({"--seed", "8"}), "amr-01-s8-m1");
  const std::string live = first_id({"--seed", "7", "--lcm-url", "memq://"});
  EXPECT_TRUE(RE2::FullMatch(live, "amr-01-[0-9]{6}-[0-9]{6}-m1")) << live;
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_NE(first_id({"--seed", "7", "--lcm-url", "memq://"}), live);
}

TEST_F(SimulateCommand, NeverStampsFutureTimes) {
  for (const auto& end : {std::vector<std::string>{"--duration", "40"},
                          std::vector<std::string>{"--missions", "1", "--mission-duration", "20"}}) {
    std::vector<std::string> words{"simulate", "--quiet",   "--robots", "2",     "--speed",
                                   "40",       "--lcm-url", "memq://",  "--log", file("a.lcmlog"),
                                   "--force"};
    words.insert(words.end(), end.begin(), end.end());
    ASSERT_EQ(run(words), Exit::ok);
    const std::int64_t now_us = host_utime_us();
    const Told told = told_by(file("a.lcmlog"));
    EXPECT_LE(told.last_utime_us, now_us);
    EXPECT_GT(told.last_utime_us, now_us - 5'000'000);
    EXPECT_GT(told.last_utime_us - told.first_utime_us, 15'000'000);
  }
  EXPECT_EQ(run({"simulate", "--quiet", "--speed", "2", "--lcm-url", "memq://"}), Exit::usage);
}

TEST_F(SimulateCommand, ReportsInvalidOptions) {
  EXPECT_EQ(run({"simulate", "--log", file("a.lcmlog")}), Exit::usage);  // without an end
  EXPECT_EQ(run({"simulate", "--speed", "0", "--missions", "1"}), Exit::usage);
  EXPECT_EQ(run({"simulate", "--robot", file("absent.json"), "--log", file("a.lcmlog"), "--duration", "1"}),
            Exit::fault);
  EXPECT_EQ(run({"simulate", "--effect", "slope", "--log", file("a.lcmlog"), "--duration", "1"}),
            Exit::usage);
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(run({"simulate", "--effect", "coulomb_fricton=1", "--log", file("a.lcmlog"), "--duration", "1"}),
            Exit::usage);
  EXPECT_NE(::testing::internal::GetCapturedStderr().find("did you mean coulomb_friction?"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(file("a.lcmlog")));
  EXPECT_EQ(run({"simulate", "--log", "/no/such/folder/a.lcmlog", "--duration", "1"}), Exit::unreachable);
  EXPECT_EQ(run({"simulate", "--rate", "0"}), std::nullopt);
  EXPECT_EQ(run({"simulate", "--robots", "0"}), std::nullopt);
  EXPECT_EQ(run({}), std::nullopt);
}

TEST_F(SimulateCommand, OverwritesOnlyWhenForced) {
  const auto simulate = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"simulate", "--quiet", "--robots", "1", "--duration", "1"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  for (const char* flag : {"--log", "--truth"}) {
    const std::string mine = file(flag);
    std::ofstream(mine) << "mine";
    std::vector<std::string> words{flag, mine};
    if (words[0] == "--truth") words.insert(words.end(), {"--log", file("b.lcmlog")});
    ::testing::internal::CaptureStderr();
    EXPECT_EQ(simulate(words), Exit::fault);
    EXPECT_EQ(::testing::internal::GetCapturedStderr(),
              "joulecast: " + std::string(flag) + ": " + mine + " already exists; --force overwrites it\n");
    EXPECT_EQ(text_of(mine), "mine");
    EXPECT_FALSE(fs::exists(file("b.lcmlog")));
    words.emplace_back("--force");
    EXPECT_EQ(simulate(words), Exit::ok);
    EXPECT_NE(text_of(mine), "mine");
  }
}

TEST_F(SimulateCommand, ReplayFailsForUnknownRobot) {
  ASSERT_EQ(run({"simulate", "--quiet", "--robots", "1", "--duration", "5", "--log", file("a.lcmlog")}),
            Exit::ok);
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(run({"replay", file("a.lcmlog"), "--into", file("h.db")}), Exit::fault);
  EXPECT_NE(::testing::internal::GetCapturedStderr().find("amr-01: " + file("h.db") + " has no model"),
            std::string::npos);
}

TEST_F(SimulateCommand, ReplayReportsLogDamage) {
  ASSERT_EQ(run({"simulate", "--quiet", "--robots", "2", "--duration", "20", "--log", file("a.lcmlog")}),
            Exit::ok);
  const std::string replay_url = "memq://";
  EXPECT_EQ(run({"replay", file("a.lcmlog"), "--speed", "0", "--lcm-url", replay_url}), Exit::ok);
  const std::string whole = text_of(file("a.lcmlog"));
  std::ofstream(file("cut.lcmlog"), std::ios::binary) << whole.substr(0, whole.size() - 5);
  EXPECT_EQ(run({"replay", file("cut.lcmlog"), "--speed", "0", "--lcm-url", replay_url}), Exit::fault);
  EXPECT_EQ(run({"replay", file("absent.lcmlog"), "--lcm-url", replay_url}), Exit::fault);
}

}  // namespace
}  // namespace joulecast::client
