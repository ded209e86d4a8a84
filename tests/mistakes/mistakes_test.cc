// Integrators' mistakes, applied to correct telemetry of virtual robots: the checks of whole recordings
// report each mistake and no other, and a running service reports it within one mission.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "plausibility/check.h"
#include "plausibility/readings.h"
#include "tests/ingest/sending_robot.h"
#include "tests/plausibility/alterations.h"
#include "tests/plausibility/made_recordings.h"
#include "tests/support/sample_robots.h"

namespace joulecast {
namespace {

using ingest::ContradictionKind;
using ingest::InboundMessage;
using robot::RobotModel;
using signals::Sample;
using telemetry::RecordingSet;

constexpr double rpm = 30 / std::numbers::pi, degrees = 180 / std::numbers::pi;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t hour_us = 3'600'000'000;

// Report of the checks of recordings.
struct Checked {
  std::string id, channel;  // the channel that is checked, or the beginning of its name
  bool contradicted = true;
};

// Report of a running service.
struct Live {
  ContradictionKind kind;
  std::string channel;
  bool untrue;        // the mission is not used for training
  std::string cause;  // in the sentence
};

struct Mistake {
  std::string name;
  std::function<void(Sample&, const RobotModel&)> sample;  // applies the mistake to each sample
  std::optional<Checked> checked;
  std::optional<Live> live;
  std::function<void(RecordingSet&, const RobotModel&)> recordings = nullptr;  // or to recordings
  std::function<void(InboundMessage&)> message = nullptr;                      // or to each message
};

using Change = std::function<void(Sample&, const RobotModel&)>;

Change times(std::vector<std::size_t> readings, double factor) {
  return [=](Sample& s, const RobotModel&) {
    for (const std::size_t k : readings) *signals::numbers_of(s)[k] *= factor;
  };
}

Change fill(std::vector<std::size_t> readings, double value) {
  return [=](Sample& s, const RobotModel&) {
    for (const std::size_t k : readings) *signals::numbers_of(s)[k] = value;
  };
}

// Readings of the right and left sides exchanged.
Change swap_sides(std::vector<std::size_t> right) {
  return [=](Sample& s, const RobotModel&) {
    for (const std::size_t k : right) std::swap(*signals::numbers_of(s)[k], *signals::numbers_of(s)[k + 1]);
  };
}

// Times of another scale, and wheel speeds multiplied.
Change slower(double scale, double wheels) {
  return [=](Sample& s, const RobotModel&) {
    constexpr std::int64_t zero_us = 1'700'000'000'000'000;
    s.utime_us = zero_us + std::llround(scale * static_cast<double>(s.utime_us - zero_us));
    for (double& speed : s.wheel_velocity_rad_s) speed *= wheels;
  };
}

Change unmeasured_is_0(std::vector<std::size_t> unmeasured) {
  return [=](Sample& s, const RobotModel& robot) {
    fill(unmeasured, 0)(s, robot);
    for (double* reading : signals::numbers_of(s)) {
      if (std::isnan(*reading)) *reading = 0;
    }
  };
}

std::vector<Mistake> all_mistakes() {
  using namespace plausibility::reading;
  using K = ContradictionKind;
  constexpr std::size_t w = wheel_velocity, v = motor_voltage, i = motor_current;
  constexpr auto unchecked = std::nullopt;
  constexpr auto recordings_only = std::nullopt;
  return {
      {"battery current reversed", times({battery_current}, -1),
       Checked{"battery_current_reversed", "battery_current"},
       Live{K::sign, "battery_current", true, "reversed"}},
      {"battery current in mA", times({battery_current}, 1000),
       Checked{"battery_current_scale", "battery_current"}, Live{K::scale, "battery_current", true, "mA"}},
      {"battery current in kA", times({battery_current}, 0.001),
       Checked{"battery_current_scale", "battery_current"}, recordings_only},
      {"battery current in mA and reversed", times({battery_current}, -1000), unchecked,
       Live{K::scale, "battery_current", true, "mA"}},
      {"battery current constant", fill({battery_current}, 3), unchecked,
       Live{K::constant, "battery_current", true, "constant"}},
      {"battery voltage in mV", times({battery_voltage}, 1000),
       Checked{"battery_voltage_scale", "battery_voltage"}, Live{K::implausible, "", true, "is it in mV?"}},
      {"battery voltage written in",
       [](Sample& s, const RobotModel& r) { s.battery_voltage_v = r.battery.nominal_voltage_v; },
       Checked{"constant_channel", "battery_voltage", false}, recordings_only},
      {"battery channels 0", fill({battery_voltage, battery_current}, 0),
       Checked{"dead_channel", "battery_voltage, battery_current"}, recordings_only},
      {"wheels in rpm", times({w, w + 1}, rpm), Checked{"wheel_velocity_scale", "wheel_velocity"},
       Live{K::scale, "wheel_velocity", true, "rpm"}},
      {"wheels in degrees a second", times({w, w + 1}, degrees),
       Checked{"wheel_velocity_scale", "wheel_velocity"}, recordings_only},
      {"motor shaft for wheels",
       [](Sample& s, const RobotModel& r) {
         times({w, w + 1}, r.motor.gear_ratio)(s, r);
       },
       Checked{"wheel_velocity_scale", "wheel_velocity"},
       Live{K::scale, "wheel_velocity", true, "motor shaft"}},
      {"wheels in m per s",
       [](Sample& s, const RobotModel& r) {
         times({w, w + 1}, r.kinematics.wheel_radius_m)(s, r);
       },
       Checked{"wheel_velocity_scale", "wheel_velocity"}, Live{K::scale, "wheel_velocity", true, "m/s"}},
      {"encoder counted twice", times({w, w + 1}, 2), Checked{"wheel_velocity_scale", "wheel_velocity"},
       Live{K::scale, "wheel_velocity", true, "2 times the motion"}},
      // Where a short mission has no two independent readings, these are named as the unit next to them.
      {"encoder counted four times", times({w, w + 1}, 4), Checked{"wheel_velocity_scale", "wheel_velocity"},
       Live{K::scale, "wheel_velocity", true, "wheel_velocity"}},
      {"encoder counted half", times({w, w + 1}, 0.5), Checked{"wheel_velocity_scale", "wheel_velocity"},
       Live{K::scale, "wheel_velocity", true, "0.5 times the motion"}},
      {"encoder counted a quarter", times({w, w + 1}, 0.25),
       Checked{"wheel_velocity_scale", "wheel_velocity"},
       Live{K::scale, "wheel_velocity", true, "wheel_velocity"}},
      {"wheels times 2 pi", times({w, w + 1}, 2 * std::numbers::pi),
       Checked{"wheel_velocity_scale", "wheel_velocity"},
       Live{K::scale, "wheel_velocity", true, "wheel_velocity"}},
      {"wheels overflow",
       [](Sample& s, const RobotModel& r) {
         const double period = 1.2 * r.limits.speed_m_s / r.kinematics.wheel_radius_m;
         for (double& speed : s.wheel_velocity_rad_s) speed = std::remainder(speed, period);
       },
       Checked{"wheel_velocity_leaps", "wheel_velocity"},
       Live{K::corrupt, "wheel_velocity", true, "overflows"}},
      {"wheels overflow below the limit",
       [](Sample& s, const RobotModel& r) {
         const double period = 0.7 * r.limits.speed_m_s / r.kinematics.wheel_radius_m;
         for (double& speed : s.wheel_velocity_rad_s) speed = std::remainder(speed, period);
       },
       Checked{"wheel_velocity_leaps", "wheel_velocity"}, recordings_only},
      {"left wheel reversed", times({w + 1}, -1), Checked{"wheel_velocity_reversed", "wheel_velocity.left"},
       Live{K::sign, "wheel_velocity.left", true, "reversed"}},
      {"right wheel reversed", times({w}, -1), Checked{"wheel_velocity_reversed", "wheel_velocity.right"},
       recordings_only},
      {"wheels reversed", times({w, w + 1}, -1), Checked{"wheel_velocity_reversed", "wheel_velocity"},
       recordings_only},
      {"wheels swapped", swap_sides({w}), Checked{"wheel_velocity_sides_swapped", "wheel_velocity"},
       Live{K::sides, "wheel_velocity", true, "swapped"}},
      {"left wheel 0", fill({w + 1}, 0), Checked{"dead_channel", "wheel_velocity.left"},
       Live{K::dead, "wheel_velocity.left", true, "0 all the time"}},
      {"wheels NaN", fill({w, w + 1}, nan), unchecked,
       Live{K::implausible, "", true, "wheel_velocity[0] must be measured"}},
      {"wheels fall to 0 for a row",
       [](Sample& s, const RobotModel& r) {
         if (s.sequence % 41 == 40) fill({w, w + 1}, 0)(s, r);
       },
       Checked{"thrown_readings", "wheel_velocity.right", false},
       Live{K::corrupt, "wheel_velocity", true, "jumps away and back"}},
      {"motor currents reversed", times({i, i + 1}, -1), Checked{"motor_current_reversed", "motor_current"},
       recordings_only},
      {"left motor current reversed", times({i + 1}, -1),
       Checked{"motor_current_reversed", "motor_current.left"}, recordings_only},
      {"right motor current reversed", times({i}, -1),
       Checked{"motor_current_reversed", "motor_current.right"}, recordings_only},
      {"motor currents in mA", times({i, i + 1}, 1000), Checked{"motor_current_scale", "motor_current"},
       recordings_only},
      {"motor currents swapped", swap_sides({i}), Checked{"motor_current_sides_swapped", "motor_current"},
       recordings_only},
      {"right motor current 0", fill({i}, 0), Checked{"dead_channel", "motor_current.right"},
       recordings_only},
      {"right motor current weak", times({i}, 0.4),
       Checked{"motor_current_against_sibling", "motor_current.right"}, recordings_only},
      {"motor currents without sign",
       [](Sample& s, const RobotModel&) {
         for (double& a : s.motor_current_a) a = std::fabs(a);
       },
       Checked{"motor_current_unsigned", "motor_current"}, recordings_only},
      {"motor voltages reversed", times({v, v + 1}, -1), Checked{"motor_voltage_reversed", "motor_voltage"},
       recordings_only},
      {"left motor voltage reversed", times({v + 1}, -1),
       Checked{"motor_voltage_reversed", "motor_voltage.left"}, recordings_only},
      {"motor voltages swapped", swap_sides({v}), Checked{"motor_voltage_sides_swapped", "motor_voltage"},
       recordings_only},
      {"motors swapped", swap_sides({v, i}), Checked{"motor_sides_swapped", "motor_voltage"},
       recordings_only},
      {"motor voltages in mV", times({v, v + 1}, 1000), Checked{"motor_voltage_scale", "motor_voltage"},
       recordings_only},
      {"supply for motor voltages",
       [](Sample& s, const RobotModel&) {
         s.motor_voltage_v = {s.battery_voltage_v, s.battery_voltage_v};
       },
       Checked{"supply_for_motor_voltage", "motor_voltage"}, recordings_only},
      {"gyro reversed", times({yaw_rate}, -1), Checked{"yaw_rate_reversed", "yaw_rate"},
       Live{K::sign, "yaw_rate", false, "reversed"}},
      {"gyro in degrees", times({yaw_rate}, degrees), Checked{"yaw_rate_scale", "yaw_rate"},
       Live{K::scale, "yaw_rate", false, "degrees"}},
      {"gyro 0", fill({yaw_rate}, 0), Checked{"dead_channel", "yaw_rate"}, recordings_only},
      {"heading reversed", times({heading}, -1), Checked{"pose_heading_reversed", "pose.heading"},
       recordings_only},
      {"heading in degrees", times({heading}, degrees), Checked{"pose_heading_scale", "pose.heading"},
       recordings_only},
      {"position in mm", times({x, y}, 1000), Checked{"pose_scale", "pose"}, recordings_only},
      {"all unmeasured 0", unmeasured_is_0({v, v + 1, i, i + 1}), Checked{"dead_channel", ""},
       recordings_only},
      {"all unmeasured and battery 0",
       unmeasured_is_0({v, v + 1, i, i + 1, battery_voltage, battery_current}), unchecked,
       Live{K::dead, "battery_voltage", true, "NaN for what is not measured"}},
      {"utime in ms", [](Sample& s, const RobotModel&) { s.utime_us /= 1000; },
       Checked{"utime_scale", "utime"}, Live{K::clock, "utime", true, "ms"}},
      {"utime in ns", [](Sample& s, const RobotModel&) { s.utime_us *= 1000; },
       Checked{"utime_scale", "utime"}, recordings_only},
      {"utime ten times too long", slower(10, 1), Checked{"utime_scale", "utime"}, recordings_only},
      {"utime a tenth", slower(0.1, 1), Checked{"utime_scale", "utime"}, recordings_only},
      {"utime and slopes over it", slower(10, 0.1), Checked{"utime_scale", "utime"}, recordings_only},
      {"utime in s", [](Sample& s, const RobotModel&) { s.utime_us /= 1'000'000; }, unchecked,
       Live{K::clock, "utime", true, "utime"}},
      {"clock set back by 5 min",
       [](Sample& s, const RobotModel&) {
         if (s.sequence > 500) s.utime_us -= hour_us / 12;
       },
       unchecked, Live{K::clock, "utime", true, "set back"}},
      {"messages of another type", nullptr, unchecked, Live{K::implausible, "", false, "message types"},
       nullptr,
       [](InboundMessage& message) {
         message.content = ingest::RefusedMessage{ingest::IngestFault::undecodable, "is of another type"};
       }},
      {"clock an hour ahead", [](Sample& s, const RobotModel&) { s.utime_us += hour_us; }, unchecked,
       Live{K::clock, "utime", false, "ahead of the service's clock"}},
      {"clock stands", [](Sample& s, const RobotModel&) { s.utime_us = 1'700'000'000'000'000; }, unchecked,
       Live{K::clock, "utime", true, "instant of sampling"}},
      {"sequence stands", [](Sample& s, const RobotModel&) { s.sequence = 0; }, unchecked,
       Live{K::sequence, "sequence", false, "one higher with each message"}},
      {"sequence counts samples that are not sent", [](Sample& s, const RobotModel&) { s.sequence *= 25; },
       unchecked, Live{K::sequence, "sequence", false, "missing sequence numbers"}},
      {"another id than the channel's", nullptr, unchecked,
       Live{K::identity, "robot_id", false, "another robot_id"}, nullptr,
       [](InboundMessage& message) {
         message.content =
             ingest::RefusedMessage{ingest::IngestFault::wrong_channel, "carries messages of robot_id other"};
       }},
      {"two senders", nullptr, Checked{"two_senders", "utime"}, recordings_only,
       [](RecordingSet& set, const RobotModel&) { alter::add_second_sender(set); }},
      {"battery current held 1 s", nullptr, Checked{"held_samples", "battery_current", false},
       recordings_only,
       [](RecordingSet& set, const RobotModel&) { alter::hold(set, {battery_current}, 1.0); }},
      {"motor currents late by 0.25 s", nullptr, Checked{"electrical_delay", "motor_current", false},
       recordings_only,
       [](RecordingSet& set, const RobotModel&) {
         alter::delay(set, {v, v + 1, i, i + 1, battery_voltage, battery_current}, 0.25);
       }},
      {"gyro late by 0.25 s", nullptr, Checked{"yaw_rate_delay", "yaw_rate", false}, recordings_only,
       [](RecordingSet& set, const RobotModel&) { alter::delay(set, {yaw_rate}, 0.25); }},
      {"battery power up by 30 % half-way", nullptr,
       Checked{"step_between_missions", "battery_current", false}, recordings_only,
       [](RecordingSet& set, const RobotModel&) { alter::step(set, {battery_current}, 1.3); }},
  };
}

std::vector<Mistake> mistakes_in(const auto expectation) {
  std::vector<Mistake> found = all_mistakes();
  std::erase_if(found, [&](const Mistake& m) { return !(m.*expectation); });
  return found;
}

std::string as_name(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isalnum(c) == 0 && c != ' '; });
  std::ranges::replace(text, ' ', '_');
  return text;
}

class MistakeInRecordings : public ::testing::TestWithParam<Mistake> {};

std::string text_of(const std::vector<plausibility::Check>& checks) {
  std::string text;
  for (const plausibility::Check& c : checks)
    text += (c.contradicted ? "X " : "  ") + c.id + ": " + c.says + "\n";
  return text;
}

TEST_P(MistakeInRecordings, IsReportedAlone) {
  // With every channel.
  static const made::Robot carrier = made::virtual_robot("amr", 21);
  const Mistake& mistake = GetParam();
  RecordingSet set = carrier.recordings;
  if (mistake.recordings) mistake.recordings(set, carrier.model);
  if (mistake.sample) alter::each_sample(set, [&](Sample& s) { mistake.sample(s, carrier.model); });
  const auto checks = plausibility::check_recordings(set, carrier.model);
  const auto found = std::ranges::find_if(checks, [&](const plausibility::Check& c) {
    return c.id == mistake.checked->id && c.channel.find(mistake.checked->channel) != std::string::npos;
  });
  ASSERT_NE(found, checks.end()) << text_of(checks);
  EXPECT_EQ(found->contradicted, mistake.checked->contradicted);
  EXPECT_GT(found->says.size(), 40u);
  EXPECT_EQ(std::ranges::count_if(checks, &plausibility::Check::contradicted),
            mistake.checked->contradicted ? 1 : 0)
      << text_of(checks);
  EXPECT_LE(checks.size(), 12u);
}

INSTANTIATE_TEST_SUITE_P(Amr, MistakeInRecordings, ::testing::ValuesIn(mistakes_in(&Mistake::checked)),
                         [](const auto& instance) { return as_name(instance.param.name); });

struct Driven {
  const char* kind;
  bool motors;
  double length_s;
};

class MistakeOfARobot : public ::testing::TestWithParam<std::tuple<Mistake, Driven>> {};

TEST_P(MistakeOfARobot, IsReportedWithinOneMission) {
  const auto& [mistake, of] = GetParam();
  static std::map<std::tuple<std::string, bool>, made::Robot> drives;
  auto drive = drives.find({of.kind, of.motors});
  if (drive == drives.end()) {
    drive = drives.emplace(std::tuple(of.kind, of.motors), ingest::drive(of.kind, of.motors, 31, of.length_s))
                .first;
  }
  ingest::Robot robot(drive->second);
  const ingest::Sent sent = robot.send([&](InboundMessage& m, Sample& s) {
    if (mistake.message) mistake.message(m);
    if (mistake.sample) mistake.sample(s, robot.model());
  });
  const Live& expected = *mistake.live;
  const ingest::Contradiction* found = sent.find(expected.kind, expected.channel);
  ASSERT_NE(found, nullptr) << sent.told();
  EXPECT_NE(found->says.find(expected.cause), std::string::npos) << found->says;
  EXPECT_TRUE(std::ranges::any_of(found->says, [](unsigned char c) { return std::isdigit(c) != 0; }))
      << found->says;
  EXPECT_EQ(found->untrue, expected.untrue);
  for (const ingest::Contradiction& c : sent.live)
    EXPECT_TRUE(c.kind == expected.kind || !c.untrue) << sent.told();
  EXPECT_EQ(std::ranges::count(sent.events, "contradiction", &history::Event::kind),
            static_cast<std::ptrdiff_t>(sent.counted));
  EXPECT_GE(sent.counted, 1u);
  EXPECT_TRUE(std::ranges::any_of(sent.warnings,
                                  [](const std::string& w) { return w.starts_with("contradiction: "); }));
  for (const history::Mission& mission : sent.missions) {
    EXPECT_EQ(history::findings_of(mission).teaches(), !expected.untrue)
        << mission.findings_json << sent.told();
  }
}

std::string name_of(const ::testing::TestParamInfo<std::tuple<Mistake, Driven>>& info) {
  const auto& [mistake, of] = info.param;
  return as_name(mistake.name + " " + of.kind + (of.motors ? "" : " without motors"));
}

INSTANTIATE_TEST_SUITE_P(
    Robots, MistakeOfARobot,
    ::testing::Combine(::testing::ValuesIn(mistakes_in(&Mistake::live)),
                       ::testing::Values(Driven{"amr", true, 40}, Driven{"amr", false, 40},
                                         Driven{"nomad", true, 40}, Driven{"tug", false, 60})),
    name_of);

TEST(SecondSender, IsNamedAndNotBooked) {
  ingest::Robot robot(ingest::drive("amr", true, 32));
  ingest::Robot alone(ingest::drive("amr", true, 32));
  const ingest::Sent sent = robot.send({}, 0x0a000006), own = alone.send();
  const ingest::Contradiction* told = sent.find(ContradictionKind::sender, "");
  ASSERT_NE(told, nullptr) << sent.told();
  EXPECT_NE(told->says.find("10.0.0.6"), std::string::npos) << told->says;
  ASSERT_EQ(sent.missions.size(), 1u);
  EXPECT_DOUBLE_EQ(sent.missions[0].accounts.measured_j, own.missions.at(0).accounts.measured_j);
  EXPECT_TRUE(history::findings_of(sent.missions[0]).teaches());
}

TEST(EndOfAnotherMission, IsNamedAtOnce) {
  testing::PipelineHarness harness;
  harness.add_robot(testing::nomad());
  constexpr std::int64_t start_us = 1'700'000'000'000'000;
  using signals::MissionPhase;
  for (const auto& [phase, id] :
       {std::pair{MissionPhase::started, "here"}, {MissionPhase::finished, "elsewhere"}})
    harness.pipeline->handle({"nomad", signals::MissionEvent{start_us, id, phase, nan, ""}, start_us});
  harness.pipeline->publish();
  EXPECT_NE(harness.fleet.find("nomad")
                ->fault_notes.at("bad_event")
                .find("mission elsewhere ends, and its start was not received"),
            std::string::npos);
}

TEST(RobotWithoutFile, IsShownWithoutModel) {
  testing::PipelineHarness harness;
  Sample s;
  s.utime_us = 1'700'000'000'000'000;
  s.wheel_velocity_rad_s = {0, 0};
  for (int k = 0; k < 50; ++k) {
    harness.pipeline->handle({"stranger", s, s.utime_us});
    s.utime_us += 20'000, ++s.sequence;
  }
  harness.pipeline->publish();
  const auto shown = harness.fleet.find("stranger");
  ASSERT_TRUE(shown);
  EXPECT_FALSE(shown->has_model);
  EXPECT_GT(shown->faults.at("unknown_robot"), 0u);
}

// Returns the declared payloads.
std::set<double> drive_missions(testing::PipelineHarness& harness, const made::Robot& robot) {
  std::set<double> declared;
  for (const telemetry::Recording& mission : robot.recordings.missions) {
    declared.insert(mission.payload_kg);
    const auto event = [&](signals::MissionPhase phase, std::int64_t at_us) {
      harness.pipeline->handle(
          {robot.model.robot_id,
           signals::MissionEvent{at_us, mission.mission_id, phase, mission.payload_kg, ""}, at_us});
    };
    event(signals::MissionPhase::started, mission.samples.front().utime_us - 1000);
    for (const Sample& s : mission.samples) harness.pipeline->handle({robot.model.robot_id, s, s.utime_us});
    event(signals::MissionPhase::finished, mission.samples.back().utime_us + 1000);
    harness.pipeline->tick(mission.samples.back().utime_us + 1'000'000);
  }
  harness.pipeline->publish();
  return declared;
}

// By a file with these factors of wheel radius and mass the unloaded robot weighs less than nothing.
TEST(WrongFile, ClaimsNothingAboutPayloads) {
  const made::Robot amr = made::virtual_robot("amr", 41, [](auto&spec) { spec.missions = 6; }),
                    nomad = made::virtual_robot("nomad", 45, [](auto&spec) { spec.missions = 6; });
  for (const made::Robot& robot : {amr, nomad})
    for (const auto& [radius, mass] : {std::pair{1.3, 0.8}, {1.3, 1.25}, {1.48, 1.0}}) {
      robot::RobotModel wrong = robot.model;
      wrong.kinematics.wheel_radius_m *= radius;
      wrong.mass.chassis_kg *= mass;
      testing::PipelineHarness harness;
      harness.add_robot(wrong);
      drive_missions(harness, robot);
      const auto now = harness.fleet.find(wrong.robot_id);
      for (const auto& c : now->contradictions) EXPECT_NE(c.id, "payload_scale") << c.says;
      const auto events = *harness.store->events(0, 100);
      for (const history::Event& event : events)
        EXPECT_NE(event.kind, "undeclared_payload") << event.detail_json;
    }
}

// A manifest in pounds that is declared in kilograms.
TEST(PayloadInPounds, IsNamedWithinTenMissions) {
  for (const bool pounds : {true, false})
    for (const auto& [kind, seed] :
         {std::pair{"amr", 41}, {"amr", 42}, {"amr", 43}, {"tug", 44}, {"nomad", 45}}) {
      const made::Robot robot = made::virtual_robot(
          kind, static_cast<std::uint64_t>(seed), [&](virtual_robot::SimulationSpec& spec) {
            spec.missions = 10;
            if (pounds)
              spec.imperfections = *virtual_robot::make_imperfections({{"payload_mass_error", -0.5464}});
          });
      testing::PipelineHarness harness;
      harness.add_robot(robot.model);
      EXPECT_GE(drive_missions(harness, robot).size(), 2u);
      const auto contradictions = harness.fleet.find(robot.model.robot_id)->contradictions;
      const auto found = std::ranges::find(contradictions, "payload_scale", &ingest::Contradiction::id);
      ASSERT_EQ(found != contradictions.end(), pounds) << seed;
      if (!pounds) continue;
      EXPECT_NE(found->says.find("given in lb"), std::string::npos);
      EXPECT_NEAR(found->value, 0.4536, std::string_view(kind) == "amr" ? 0.06 : 0.1);
      EXPECT_EQ(std::ranges::count_if(harness.warnings,
                                      [](const std::string& w) { return w.find("given in lb") != w.npos; }),
                1);
    }
}

TEST(RowsOfTenSeconds, AreDatedInMicroseconds) {
  RecordingSet set = made::virtual_robot("amr", 52).recordings;
  for (telemetry::Recording& mission : set.missions) {
    const std::int64_t begin_us = mission.samples.front().utime_us;
    for (Sample& s : mission.samples) s.utime_us = begin_us + 500 * (s.utime_us - begin_us);
  }
  const auto checks = plausibility::check_recordings(set, made::virtual_robot("amr", 52).model);
  EXPECT_TRUE(std::ranges::none_of(checks, [](const auto& c) { return c.id.starts_with("utime_scale"); }))
      << text_of(checks);
}

// Every 25th sample of 50 Hz, numbered without gaps.
TEST(SlowStream, IsNamedWithinFifteenSeconds) {
  const made::Robot robot = ingest::drive("amr", true, 51);
  for (const std::size_t every : {25u, 5u}) {
    testing::PipelineHarness harness;
    harness.add_robot(robot.model);
    const auto& samples = robot.recordings.missions.front().samples;
    const std::int64_t begin_us = samples.front().utime_us;
    const auto event = signals::MissionEvent{begin_us - 1000, "m", signals::MissionPhase::started, nan, ""};
    harness.pipeline->handle({robot.model.robot_id, event, begin_us - 1000});
    for (std::size_t k = 0; k < samples.size() && samples[k].utime_us < begin_us + 15'000'000; k += every) {
      Sample s = samples[k];
      s.sequence = static_cast<std::int64_t>(k / every);
      harness.pipeline->handle({robot.model.robot_id, s, s.utime_us});
    }
    harness.pipeline->publish();
    const auto shown = harness.fleet.find(robot.model.robot_id)->contradictions;
    const auto found = std::ranges::find(shown, "utime_slow", &ingest::Contradiction::id);
    ASSERT_EQ(found != shown.end(), every == 25);
    if (found == shown.end()) continue;
    EXPECT_NE(found->says.find("slow stream of 2 Hz"), std::string::npos) << found->says;
    EXPECT_FALSE(found->untrue);
  }
}

TEST(SoundRobots, PassAllChecks) {
  struct Case {
    const char* kind;
    std::uint64_t seed;
    std::vector<virtual_robot::EffectStrength> effects;
  };
  for (const Case& c :
       {Case{"amr", 21, {}}, Case{"nomad", 22, {}}, Case{"p3dx", 23, {}}, Case{"tug", 24, {}},
        Case{"amr", 25, {{"coulomb_friction", 1.5}}}, Case{"tug", 26, {{"current_sensor_gain", 0.2}}},
        Case{"nomad", 27, {{"turning_scrub", 0.5}}}, Case{"p3dx", 28, {{"torque_constant_loss", 0.3}}},
        Case{"amr", 29, {{"slope", 0.05}}}, Case{"tug", 30, {{"track_error", 0.3}}}}) {
    for (const bool motors : {true, false}) {
      const made::Robot robot = made::virtual_robot(c.kind, c.seed, [&](virtual_robot::SimulationSpec& spec) {
        spec.sensors.motor_channels = motors;
        spec.imperfections = *virtual_robot::make_imperfections(c.effects);
      });
      const auto checks = plausibility::check_recordings(robot.recordings, robot.model);
      EXPECT_TRUE(std::ranges::none_of(checks, &plausibility::Check::contradicted))
          << c.kind << c.seed << text_of(checks);
      EXPECT_LE(checks.size(), c.effects.empty() ? 0u : 2u) << c.kind << c.seed << text_of(checks);
      RecordingSet possible = robot.recordings;
      EXPECT_EQ(text_of(plausibility::drop_impossible(possible, robot.model)), "") << c.kind << c.seed;
    }
  }
}

}  // namespace
}  // namespace joulecast
