// Findings of `joulecast check` in files, and the exit codes that scripts rely on.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/commands/check_findings.h"
#include "client/commands/listen.h"
#include "client/commands/table.h"
#include "telemetry/event_log.h"
#include "telemetry/log_recordings.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::client {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

class CheckCommand : public ::testing::Test {
 protected:
  CheckCommand() {
    std::string name = (fs::temp_directory_path() / "joulecast-check-XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~CheckCommand() override { fs::remove_all(folder_); }

  std::string file(const std::string& name, const std::string& text) {
    std::ofstream{folder_ / name} << text;
    return (folder_ / name).string();
  }
  // Returns the exit code; the output is in printed_.
  Exit check(std::vector<std::string> words) {
    CLI::App program("joulecast");
    Exit exit = Exit::internal;
    add_check(program, exit);
    words.insert(words.begin(), "check");
    std::reverse(words.begin(), words.end());
    ::testing::internal::CaptureStdout();
    program.parse(words);
    printed_ = ::testing::internal::GetCapturedStdout();
    return exit;
  }

  fs::path folder_;
  std::string printed_;
  json amr_ = json::parse(std::ifstream(JOULECAST_SOURCE_DIR "/deploy/robots/amr.json"));
};

TEST_F(CheckCommand, ClassifiesRobotFiles) {
  EXPECT_EQ(check({file("a.json", amr_.dump())}), Exit::ok);
  EXPECT_THAT(printed_, HasSubstr("reach 1.74 m/s"));

  json direct = amr_;
  direct["motor"].erase("gear_ratio");
  EXPECT_EQ(check({file("b.json", direct.dump())}), Exit::warned);
  EXPECT_THAT(printed_, HasSubstr("/motor/gear_ratio: is 1, the default"));

  json faulty = amr_;
  faulty["mass"]["wheel_kg"] = "heavy";
  faulty["battery"]["capacity_ah"] = -2;
  EXPECT_EQ(check({file("c.json", faulty.dump()), "--json"}), Exit::fault);
  const json told = json::parse(printed_)["findings"];
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[0]["severity"], "fault");
  EXPECT_THAT(printed_, HasSubstr("/mass/wheel_kg"));
  EXPECT_THAT(printed_, HasSubstr("/battery/capacity_ah"));
  EXPECT_EQ(check({file("d.json", "{")}), Exit::fault);

  json stuck = amr_;
  stuck["motor"]["resistance_ohm"] = 500;
  EXPECT_EQ(check({file("e.json", stuck.dump())}), Exit::fault);
  EXPECT_THAT(printed_, HasSubstr("the motors cannot drive it"));
}

TEST_F(CheckCommand, ReadsTableThroughMapping) {
  std::string csv = "t,r,l,v,i\n";
  for (int k = 0; k < 200; ++k)
    csv += std::to_string(0.05 * k) + "," + std::to_string(0.1 * k) + ",1.5," +
           std::to_string(24 - 0.01 * k) + ",0\n";
  const std::string table = file("run.csv", csv);
  const json mapping = {{"robot_id", "amr"},
                        {"time", {{"column", "t"}, {"unit", "s"}}},
                        {"fields",
                         {{"wheel_velocity", {{{"column", "r"}}, {{"column", "l"}}}},
                          {"battery_voltage", {{"column", "v"}}},
                          {"battery_current", {{"column", "i"}}}}}};
  const std::string how = file("m.json", mapping.dump());
  EXPECT_EQ(check({how}), Exit::ok);
  // A current of 0 while the robot drives is not a measurement.
  EXPECT_EQ(check({table, "--mapping", how}), Exit::fault);
  EXPECT_THAT(printed_, HasSubstr("battery_current: is 0 in all 200 messages"));
  EXPECT_THAT(printed_, HasSubstr("20 a second"));
  EXPECT_EQ(check({table}), Exit::usage);

  json wrong = mapping;
  wrong["time"]["unit"] = "minutes";
  EXPECT_EQ(check({file("w.json", wrong.dump())}), Exit::fault);
  EXPECT_THAT(printed_, HasSubstr("/time/unit"));

  // Without its fields it is no robot file either.
  json bare = mapping;
  bare.erase("fields");
  EXPECT_EQ(check({file("b.json", bare.dump())}), Exit::fault);
  EXPECT_THAT(printed_, HasSubstr("b.json: mapping"));

  wrong["robot_id"] = "a b";
  wrong["fields"]["speed"] = 1;
  EXPECT_EQ(check({file("v.json", wrong.dump()), "--json"}), Exit::fault);
  std::vector<std::string> fields;
  const json said = json::parse(printed_);
  for (const json& finding : said["findings"]) fields.push_back(finding["field"].get<std::string>());
  EXPECT_THAT(fields, ::testing::UnorderedElementsAre("/robot_id", "/time/unit", "/fields/speed"));
}

TEST_F(CheckCommand, ReportsUnmeasuredBatteryPower) {
  const auto table_of = [&](const std::string& name, bool lacks) {
    std::string csv = "t,r,l,v,i\n";
    for (int k = 0; k < 200; ++k)
      csv += fmt::format("{},{},{},{},{}\n", 0.05 * k, 0.1 * k, 0.09 * k, 24 - 0.01 * k,
                         lacks && k % 7 == 0 ? "" : fmt::to_string(3 + 0.01 * k));
    return file(name, csv);
  };
  const std::string table = table_of("run.csv", true);
  json mapping = {{"robot_id", "amr"},
                  {"time", {{"column", "t"}, {"unit", "s"}}},
                  {"empty_cells", "unmeasured"},
                  {"fields",
                   {{"wheel_velocity", {{{"column", "r"}}, {{"column", "l"}}}},
                    {"battery_voltage", {{"column", "v"}}},
                    {"battery_current", {{"column", "i"}}}}}};
  check({table_of("whole.csv", false), "--mapping", file("m.json", mapping.dump())});
  EXPECT_THAT(printed_, ::testing::Not(HasSubstr("battery_current:")));
  EXPECT_EQ(check({table, "--mapping", file("m.json", mapping.dump())}), Exit::warned);
  EXPECT_THAT(printed_, HasSubstr("battery_voltage, battery_current: one of them is missing in 29\n"));
  mapping["fields"].erase("battery_voltage");
  EXPECT_EQ(check({table, "--mapping", file("n.json", mapping.dump())}), Exit::warned);
  EXPECT_THAT(printed_, HasSubstr("one of them is missing in 200\n"));
}

TEST_F(CheckCommand, NamesDoubledCountsOfTables) {
  made::Robot robot = made::virtual_robot("amr", 3, [](auto& spec) {
    spec.sensors.motor_channels = false;
    spec.missions = 1;
  });
  std::string csv = "t,r,l,v,i\n";
  for (const signals::Sample& s : robot.recordings.missions[0].samples)
    csv +=
        fmt::format("{},{},{},{},{}\n", 1e-6 * static_cast<double>(s.utime_us), 2 * s.wheel_velocity_rad_s[0],
                    2 * s.wheel_velocity_rad_s[1], s.battery_voltage_v, s.battery_current_a);
  const std::string table = file("doubled.csv", csv);
  json mapping = {{"robot_id", "amr"},
                  {"time", {{"column", "t"}, {"unit", "s"}}},
                  {"fields",
                   {{"wheel_velocity", {{{"column", "r"}}, {{"column", "l"}}}},
                    {"battery_voltage", {{"column", "v"}}},
                    {"battery_current", {{"column", "i"}}}}}};
  const std::string how = file("m.json", mapping.dump()), amr = file("a.json", amr_.dump());
  EXPECT_EQ(check({table, "--mapping", how}), Exit::ok);
  EXPECT_THAT(printed_, HasSubstr("units and signs were not checked: that needs --robot FILE"));
  EXPECT_EQ(check({table, "--mapping", how, "--robot", amr}), Exit::fault);
  EXPECT_THAT(printed_, HasSubstr("fault amr: wheel_velocity_scale: wheel_velocity looks counted twice"));
  // Divided once too often.
  for (json& side : mapping["fields"]["wheel_velocity"]) side["divide_by"] = 2673.8;
  EXPECT_EQ(check({table, "--mapping", file("n.json", mapping.dump()), "--robot", amr}), Exit::warned);
  EXPECT_THAT(printed_, HasSubstr("wheel_velocity: no wheel turned faster than 0.0"));
}

TEST_F(CheckCommand, NamesPlaceOfTableErrors) {
  const std::string how = file("m.json", R"({"robot_id": "amr", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}]}})");
  const std::string table = file("twice.csv", "t,r,l,t\n0,1,1,0\n");
  EXPECT_EQ(check({table, "--mapping", how, "--json"}), Exit::fault);
  const json finding = json::parse(printed_)["findings"].back();
  EXPECT_EQ(finding["about"], table);
  EXPECT_EQ(finding["field"], "line 1");
}

TEST_F(CheckCommand, DetectedSettingsAreNoWarnings) {
  std::string csv = "t;r;l;v;i\n";
  for (int k = 0; k < 200; ++k)
    csv += fmt::format("{},{:02};{};{},5;2{};{}\n", k / 20, k % 20 * 5, k, k, k % 7, k % 5);
  const std::string how = file("m.json", R"({"robot_id": "amr", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}],
      "battery_voltage": {"column": "v"}, "battery_current": {"column": "i"}}})");
  EXPECT_EQ(check({file("run.csv", csv), "--mapping", how}), Exit::ok);
  EXPECT_THAT(printed_, HasSubstr("run.csv: table; the separator is ';', the decimal sign ','\n"));
}

TEST_F(CheckCommand, RestartedTimesAreMissions) {
  std::string csv = "t,r,l,v,i\n";
  for (int k = 0; k < 600; ++k) csv += fmt::format("{:.2f},{},1,,nan\n", 0.05 * (k % 200) - 1, k);
  const std::string how = file("m.json", R"({"robot_id": "amr", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}],
      "battery_voltage": {"column": "v"}, "battery_current": {"column": "i"}}})");
  EXPECT_EQ(check({file("run.csv", csv), "--mapping", how, "--json"}), Exit::warned);
  EXPECT_THAT(printed_, HasSubstr("line 202: the time goes back by 9.95 s: a new mission begins"));
  EXPECT_THAT(printed_, HasSubstr("the time goes back at 2 lines, the last one line 402"));
  EXPECT_THAT(printed_, ::testing::Not(HasSubstr("gap")));
  EXPECT_THAT(printed_, HasSubstr("no row has a value of battery_voltage"));
  EXPECT_THAT(printed_, HasSubstr("no row has a value of battery_current"));
}

TEST_F(CheckCommand, ReportsOverlappingDatedTables) {
  const auto dated = [](int minute) {
    std::string csv = "t,r,l\n";
    for (int k = 0; k < 300; ++k)
      csv += fmt::format("2026-03-02T08:{:02}:{:02}Z,{},1\n", minute + k / 60, k % 60, k);
    return csv;
  };
  const std::string how = file("m.json", R"({"robot_id": "amr", "time": {"column": "t", "unit": "iso8601"},
      "fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}]}})");
  const std::string first = file("a.csv", dated(0));
  EXPECT_EQ(check({first, file("b.csv", dated(10)), "--mapping", how}), Exit::warned);
  EXPECT_EQ(check({first, file("c.csv", dated(3)), "--mapping", how}), Exit::fault);
  EXPECT_THAT(printed_, HasSubstr("clock"));
}

TEST_F(CheckCommand, ReportsRowsOutOfOrder) {
  std::string csv = "t,r,l\n";
  for (int k = 0; k < 200; ++k) csv += std::to_string(0.05 * (k ^ 1)) + ",1,1.5\n";
  const std::string how = file("m.json", R"({"robot_id": "amr", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}]}})");
  (void)check({file("run.csv", csv), "--mapping", how});
  EXPECT_THAT(printed_, HasSubstr("100 rows were out of order"));
  EXPECT_THAT(printed_, HasSubstr("200 messages"));
}

TEST(DaemonState, ReportsContradictionsOfSilentRobot) {
  const json state = {{"live", false},
                      {"has_model", true},
                      {"faults", json::object()},
                      {"fault_notes", json::object()},
                      {"contradictions",
                       {{{"id", "battery_current_reversed"},
                         {"channel", "battery_current"},
                         {"says", "battery_current looks reversed"},
                         {"untrue", true}}}}};
  Findings findings;
  judge_state(state, "amr", findings);
  ASSERT_EQ(findings.size(), 2u);
  EXPECT_EQ(findings[1].field, "battery_current");
  EXPECT_TRUE(findings[1].fault);
  EXPECT_THAT(findings[1].says, HasSubstr("looks reversed"));
}

TEST(Channels, OmitsLossForTwoSenders) {
  telemetry::ChannelTally tally;
  tally.sequence.missing = 699'760;
  tally.sequence.late = 239;
  EXPECT_EQ(faults_of(tally), "699521 missing; 239 late");
  tally.senders = {{0x0a000005, 40'000}, {0x0a000006, 40'001}};
  EXPECT_EQ(faults_of(tally),
            "2 senders, 10.0.0.5:40000 and 10.0.0.6:40001: each robot needs its own robot_id");
}

// Missions with pauses between them: the rate is that of the samples within.
TEST(Channels, SlowStreamsAreNamed) {
  for (const int hz : {1, 2, 10, 50}) {
    telemetry::ChannelWatch watch;
    signals::Sample sample;
    sample.utime_us = 1'700'000'000'000'000;
    sample.wheel_velocity_rad_s = {1, 1};
    for (int mission = 0; mission < 3; ++mission, sample.utime_us += 600'000'000)
      for (int k = 0; k < 60 * hz; ++k, ++sample.sequence, sample.utime_us += 1'000'000 / hz)
        watch.add("slow", sample);
    const auto& [channel, tally] = *watch.channels().begin();
    Findings findings;
    judge(channel, tally, false, findings);
    const auto slow = std::ranges::find_if(
        findings, [](const Finding& f) { return f.says.starts_with("is a slow stream"); });
    ASSERT_EQ(slow != findings.end(), hz < 5) << hz;
    if (hz >= 5) continue;
    EXPECT_FALSE(slow->fault);
    EXPECT_NEAR(*slow->value, hz, 0.01 * hz);
  }
}

// As in an imported log.
TEST_F(CheckCommand, DaysBetweenMissionsAreSound) {
  auto robot = made::virtual_robot("amr", 52, [](virtual_robot::SimulationSpec& spec) { spec.missions = 2; });
  const std::string path = (folder_ / "days.lcmlog").string();
  auto log = telemetry::EventLogWriter::create(path);
  ASSERT_TRUE(log);
  for (telemetry::Recording& mission : robot.recordings.missions) {
    if (&mission != &robot.recordings.missions[0])
      for (signals::Sample& sample : mission.samples) sample.utime_us += 86'400'000'000;
    ASSERT_TRUE(telemetry::write_recording(*log, mission));
  }
  ASSERT_TRUE(log->close());
  EXPECT_EQ(check({path, "--robot", JOULECAST_SOURCE_DIR "/deploy/robots/amr.json"}), Exit::ok) << printed_;
}

TEST_F(CheckCommand, ImportNumbersOnOverMissions) {
  const auto table = [&](const std::string& name, int begin_s) {
    std::string csv = "t,run,r,l\n";
    for (int k = 0; k < 40; ++k)
      csv += std::to_string(begin_s + k) + (k < 20 ? ",a," : ",b,") + std::to_string(k % 7) + ",2\n";
    return file(name, csv);
  };
  const std::string mapping = file("m.json", R"({"robot_id": "amr", "mission_id": "{stem}-{mission}",
      "mission": {"column": "run"}, "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}]}})");
  const std::string log = (folder_ / "all.lcmlog").string();
  CLI::App program("joulecast");
  Exit exit = Exit::internal;
  add_import(program, exit);
  // The later table first.
  std::vector<std::string> words{
      "import", table("2.csv", 1'700'009'000), table("1.csv", 1'700'000'000), "--mapping", mapping, "--out",
      log};
  std::reverse(words.begin(), words.end());
  ::testing::internal::CaptureStdout();
  program.parse(words);
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), HasSubstr("4 missions"));
  ASSERT_EQ(exit, Exit::ok);
  const auto read = telemetry::read_recordings(std::vector{log}, "amr", {});
  ASSERT_TRUE(read);
  std::vector<std::string> missions;
  std::int64_t next = 0;
  for (const telemetry::Recording& mission : read->recordings) {
    missions.push_back(mission.mission_id);
    for (const signals::Sample& sample : mission.samples) EXPECT_EQ(sample.sequence, next++);
  }
  EXPECT_THAT(missions, ::testing::ElementsAre("1-a", "1-b", "2-a", "2-b"));
  EXPECT_EQ(next, 80);
  check({log});
  EXPECT_THAT(printed_, ::testing::Not(HasSubstr("restart")));
}

TEST_F(CheckCommand, ReplayWithoutMissionsFails) {
  auto robot = made::virtual_robot("amr", 52, [](virtual_robot::SimulationSpec& spec) { spec.missions = 1; });
  telemetry::Recording& mission = robot.recordings.missions[0];
  for (signals::Sample& sample : mission.samples) sample.battery_voltage_v *= 1000;
  const std::string path = (folder_ / "millivolts.lcmlog").string();
  auto log = telemetry::EventLogWriter::create(path);
  ASSERT_TRUE(log);
  ASSERT_TRUE(telemetry::write_recording(*log, mission));
  ASSERT_TRUE(log->close());
  CLI::App program("joulecast");
  Exit exit = Exit::ok;
  add_replay(program, exit);
  std::vector<std::string> words{
      "replay", path, "--into", (folder_ / "history.db").string(), "--robot", file("amr.json", amr_.dump())};
  std::reverse(words.begin(), words.end());
  program.parse(words);
  EXPECT_EQ(exit, Exit::fault);
}

TEST_F(CheckCommand, ImpossibleVoltagesAreCounted) {
  const auto robot =
      made::virtual_robot("amr", 52, [](virtual_robot::SimulationSpec& spec) { spec.missions = 1; });
  for (const std::size_t wrong :
       {std::size_t{0}, std::size_t{1}, robot.recordings.missions[0].samples.size() / 2}) {
    telemetry::Recording mission = robot.recordings.missions[0];
    for (std::size_t k = 0; k < wrong; ++k)
      mission.samples[k].battery_voltage_v = mission.samples[k].battery_current_a = 0;
    const std::string path = (folder_ / "run.lcmlog").string();
    auto log = telemetry::EventLogWriter::create(path);
    ASSERT_TRUE(log);
    ASSERT_TRUE(telemetry::write_recording(*log, mission));
    ASSERT_TRUE(log->close());
    const Exit exit = check({path, "--robot", JOULECAST_SOURCE_DIR "/deploy/robots/amr.json"});
    EXPECT_EQ(exit == Exit::fault, wrong > 1) << printed_;
    const std::string sentence = "impossible_readings: " + std::to_string(wrong) + " of ";
    EXPECT_EQ(printed_.find(sentence) != std::string::npos, wrong > 0) << printed_;
  }
}

TEST(Listening, SilenceNamesAddressAndChannels) {
  Listened heard;
  EXPECT_THAT(
      why_silent("udpm://239.0.0.1:7667?ttl=0", heard),
      testing::AllOf(HasSubstr("on udpm://239.0.0.1:7667?ttl=0; nothing arrived"), HasSubstr("ttl=1")));
  for (const char* channel : {"ODOM", "CAMERA", "ODOM"}) heard.datagrams.note_other_channel(channel);
  EXPECT_THAT(why_silent("udpm://x", heard),
              HasSubstr("other channels: CAMERA, ODOM. Robots publish ROBOT_TELEMETRY"));
  for (int k = 0; k < 100; ++k) heard.datagrams.note_other_channel("C" + std::to_string(k));
  EXPECT_EQ(heard.datagrams.other_channels.size(), telemetry::DatagramCounters::max_other_channels);
  EXPECT_THAT(why_silent("udpm://x", heard), HasSubstr(" and more"));
}

TEST_F(CheckCommand, ForeignLogsNameTheirChannels) {
  const std::string path = (folder_ / "foreign.lcmlog").string();
  auto log = telemetry::EventLogWriter::create(path);
  const std::vector<std::uint8_t> body(8);
  for (const char* channel : {"ODOM", "CAMERA"}) ASSERT_TRUE(log->write(1'000'000, channel, body));
  ASSERT_TRUE(log->close());
  EXPECT_EQ(check({path}), Exit::fault);
  EXPECT_THAT(printed_, HasSubstr("CAMERA, ODOM"));
  CLI::App program("joulecast");
  Exit exit = Exit::ok;
  add_replay(program, exit);
  for (const std::vector<std::string>& to :
       {std::vector<std::string>{"--lcm-url", "memq://"}, {"--into", (folder_ / "h.db").string()}}) {
    std::vector<std::string> words{"replay", path, to[0], to[1]};
    std::reverse(words.begin(), words.end());
    ::testing::internal::CaptureStderr();
    program.parse(words);
    EXPECT_NE(exit, Exit::ok);
    EXPECT_THAT(::testing::internal::GetCapturedStderr(), HasSubstr("CAMERA, ODOM"));
  }
}

TEST_F(CheckCommand, ContradictedChannelsAreNotCalibrated) {
  const auto robot = made::virtual_robot("amr", 51, [](virtual_robot::SimulationSpec& spec) {
    spec.missions = 2;
    spec.sensors.motor_channels = false;
  });
  const auto calibrate = [&](double current_factor, std::vector<std::string> more) {
    const std::string path = (folder_ / "run.lcmlog").string();
    auto log = telemetry::EventLogWriter::create(path);
    EXPECT_TRUE(log);
    for (telemetry::Recording mission : robot.recordings.missions) {
      for (signals::Sample& s : mission.samples) s.battery_current_a *= current_factor;
      EXPECT_TRUE(telemetry::write_recording(*log, mission));
    }
    EXPECT_TRUE(log->close());
    CLI::App program("joulecast");
    Exit exit = Exit::internal;
    add_calibrate(program, exit);
    std::vector<std::string> words{"calibrate",
                                   "drive",
                                   path,
                                   "--robot",
                                   JOULECAST_SOURCE_DIR "/deploy/robots/amr.json",
                                   "--out",
                                   (folder_ / "out.json").string(),
                                   "--force"};
    words.insert(words.end(), more.begin(), more.end());
    std::ranges::reverse(words);
    fs::remove(folder_ / "out.json");
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    program.parse(words);
    (void)::testing::internal::GetCapturedStdout();
    printed_ = ::testing::internal::GetCapturedStderr();
    return exit;
  };
  EXPECT_EQ(calibrate(1, {}), Exit::ok) << printed_;
  EXPECT_TRUE(fs::exists(folder_ / "out.json"));
  EXPECT_NE(calibrate(-1, {}), Exit::ok);
  EXPECT_THAT(printed_, HasSubstr("battery_current looks reversed"));
  EXPECT_FALSE(fs::exists(folder_ / "out.json"));
  (void)calibrate(-1, {"--contradicted"});
  EXPECT_THAT(printed_, ::testing::Not(HasSubstr("looks reversed")));
}

}  // namespace
}  // namespace joulecast::client
