// One log gives the same accounts offline, as `joulecast replay --into` computes them, and from a daemon that
// receives it over LCM, at any rate and with gaps, losses and a restart.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "energy/calibration.h"
#include "telemetry/codec.h"
#include "telemetry/lcm_link.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::ingest {
namespace {

using signals::MissionEvent;
using signals::MissionPhase;
using signals::Sample;
using testing::PipelineHarness;

constexpr std::int64_t recording_start_us = 1'750'000'000'000'000;

// The sample at an instant of a drive with stops and turns.
Sample reading(double t_s, std::int64_t sequence) {
  Sample s;
  s.utime_us = recording_start_us + std::llround(1e6 * t_s);
  s.sequence = sequence;
  const double speed = 3 * (1 - std::cos(0.21 * t_s)), turn = 0.5 * std::sin(0.13 * t_s);
  s.wheel_velocity_rad_s = {speed + turn, speed - turn};
  s.battery_voltage_v = 24.5 - 0.1 * speed;
  s.battery_current_a = 1 + 0.6 * speed + 0.8 * std::sin(0.21 * t_s);
  s.payload_kg = 2;
  return s;
}

struct Log {
  std::string name;
  std::vector<Sample> samples = {};  // as sent
  double gap_s = 0;
};

Log log_of(const std::string& name, double duration_s, const std::function<double(std::int64_t)>& step_s) {
  Log log{name};
  double t_s = 0;
  for (std::int64_t k = 0; t_s < duration_s; t_s += step_s(k++)) log.samples.push_back(reading(t_s, k));
  return log;
}

Log regular(double rate_hz, double duration_s) {
  return log_of(std::to_string(rate_hz) + " Hz", duration_s, [=](std::int64_t) { return 1 / rate_hz; });
}

void lose(Log& log, const std::function<bool(const Sample&)>& lost) {
  std::erase_if(log.samples, lost);
}

std::vector<Log> recordings() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> shake(-0.02, 0.02), exponent(-0.5, 0.5);
  std::vector<Log> logs{regular(0.1, 900), regular(0.6, 300), regular(5, 120), regular(500, 20)};
  logs.push_back(
      log_of("1 Hz, shaking", 120, [&](std::int64_t) { return 1 + shake(random) - shake(random); }));
  logs.push_back(log_of("50, 5 and 1 Hz in turn", 120, [](std::int64_t k) {
    constexpr std::array steps_s{0.02, 0.2, 1.0};
    return steps_s[static_cast<std::size_t>(k / 20 % 3)];
  }));
  logs.push_back(log_of("irregular", 300, [&](std::int64_t) { return std::pow(10.0, exponent(random)); }));
  logs.push_back(regular(4, 200));
  logs.back().name = "4 Hz, three in ten lost";
  lose(logs.back(), [&](const Sample& s) { return s.sequence > 0 && random() % 10 < 3; });
  logs.push_back(regular(50, 60));
  logs.back().name = "50 Hz with a dropout of 3 s";
  logs.back().gap_s = 3;
  lose(logs.back(), [](const Sample& s) { return s.sequence > 1000 && s.sequence < 1150; });
  logs.push_back(regular(20, 60));
  logs.back().name = "20 Hz, doubled and swapped";
  for (std::size_t k = 10; k + 2 < logs.back().samples.size(); k += 10) {
    std::swap(logs.back().samples[k], logs.back().samples[k + 1]);
    logs.back().samples[k + 2] = logs.back().samples[k + 1];
  }
  return logs;
}

std::vector<Sample> in_order(const Log& log) {
  std::vector<Sample> samples = log.samples;
  telemetry::put_in_order(samples);
  return samples;
}

MissionEvent mission_event(const Log& log, MissionPhase phase) {
  const std::vector<Sample> samples = in_order(log);
  const bool begins = phase == MissionPhase::started;
  return {begins ? samples.front().utime_us : samples.back().utime_us, "m", phase, 2, ""};
}

history::Mission offline(const Log& log) {
  PipelineHarness harness;
  harness.add_robot(testing::nomad());
  const auto handle = [&](auto content, std::int64_t utime_us) {
    harness.pipeline->handle({"nomad", content, utime_us});
  };
  handle(mission_event(log, MissionPhase::started), recording_start_us);
  for (const Sample& s : log.samples) handle(s, s.utime_us);
  handle(mission_event(log, MissionPhase::finished), log.samples.back().utime_us);
  harness.pipeline->finish();
  return harness.missions().at(0);
}

// The defaults of the daemon's settings, by their schema.
SessionSettings settings_of_daemon() {
  std::ifstream file(JOULECAST_SOURCE_DIR "/schemas/config.schema.json");
  const nlohmann::json schema = nlohmann::json::parse(file);
  const auto number = [&](const char* group, const char* name) {
    return schema["properties"][group]["properties"][name]["default"].get<double>();
  };
  SessionSettings session;
  session.meter.gap_bridge_s = number("ingest", "gap_bridge_s");
  session.meter.tolerance = number("meter", "tolerance");
  session.reorder_us = std::llround(1e6 * number("ingest", "reorder_s"));
  return session;
}

// `restart_at`: the daemon stops before this sample, and the next goes on.
history::Mission by_daemon(const Log& log, std::size_t restart_at = SIZE_MAX, bool killed = false) {
  PipelineHarness harness(settings_of_daemon());
  harness.add_robot(testing::nomad());
  telemetry::DatagramCounters datagrams;
  auto link = telemetry::LcmLink::open("memq://").value();
  std::int64_t host_utime_us = recording_start_us;
  const auto hear = [&](const telemetry::Received& received) {
    const auto message = decode_message(received.channel, received.data, host_utime_us, harness.counters);
    ASSERT_TRUE(message);
    harness.pipeline->handle(*message);
  };
  EXPECT_TRUE(link.listen(hear, datagrams));
  const auto send = [&](const std::string& channel, const Result<std::vector<std::uint8_t>>& bytes) {
    EXPECT_TRUE(link.publish(channel, bytes.value()));
    while (link.poll(std::chrono::milliseconds(0)).value() > 0) continue;
  };
  send("MISSION_EVENT.nomad",
       telemetry::encode_mission_event("nomad", mission_event(log, MissionPhase::started)));
  for (std::size_t k = 0; k < log.samples.size(); ++k) {
    for (; host_utime_us + 1'000'000 <= log.samples[k].utime_us; host_utime_us += 1'000'000)
      harness.pipeline->tick(host_utime_us);
    if (k == restart_at) {
      killed ? harness.pipeline->tick(host_utime_us + 1'000'000) : harness.pipeline->suspend();
      harness.restart();
    }
    send("ROBOT_TELEMETRY.nomad", telemetry::encode_telemetry("nomad", log.samples[k]));
  }
  send("MISSION_EVENT.nomad",
       telemetry::encode_mission_event("nomad", mission_event(log, MissionPhase::finished)));
  return harness.missions().at(0);
}

void expect_same(const history::Mission& a, const history::Mission& b, double tolerance) {
  EXPECT_NEAR(a.accounts.measured_j, b.accounts.measured_j, tolerance * a.accounts.measured_j);
  EXPECT_NEAR(a.accounts.modelled_j, b.accounts.modelled_j, tolerance * a.accounts.measured_j);
  EXPECT_NEAR(a.accounts.distance_m, b.accounts.distance_m, tolerance * a.accounts.distance_m);
  EXPECT_NEAR(a.accounts.duration_s, b.accounts.duration_s, 1e-6);
  EXPECT_EQ(a.gap_count, b.gap_count);
  EXPECT_EQ(a.incomplete, b.incomplete);
  EXPECT_EQ(a.samples, b.samples);
}

// Of linear readings between samples (Simpson's rule is exact), but over steps of more than 2.9 s in a log
// with a gap.
double energy_of(const Log& log) {
  const std::vector<Sample> samples = in_order(log);
  double sum_j = 0;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const Sample &a = samples[k - 1], &b = samples[k];
    const double step_s = 1e-6 * static_cast<double>(b.utime_us - a.utime_us);
    if (log.gap_s > 0 && step_s > 2.9) continue;
    sum_j += step_s / 6 *
             (a.battery_voltage_v * a.battery_current_a +
              (a.battery_voltage_v + b.battery_voltage_v) * (a.battery_current_a + b.battery_current_a) +
              b.battery_voltage_v * b.battery_current_a);
  }
  return sum_j;
}

TEST(SameEnergies, OfflineAndOverLcm) {
  for (const Log& log : recordings()) {
    SCOPED_TRACE(log.name);
    const history::Mission replayed = offline(log), heard = by_daemon(log);
    expect_same(replayed, heard, 1e-6);
    EXPECT_NEAR(heard.accounts.measured_j, energy_of(log), 2e-5 * energy_of(log));
    EXPECT_EQ(heard.gap_count, log.gap_s > 0 ? 1 : 0);
    EXPECT_NEAR(heard.gap_s, log.gap_s, 1e-6);
    EXPECT_EQ(heard.incomplete, log.gap_s > 0);
    const std::vector<Sample> samples = in_order(log);
    const signals::Accounts alone = energy::metered(testing::nomad(), {"", samples, 2}, {}).value();
    EXPECT_NEAR(alone.measured_j, heard.accounts.measured_j, 1e-6 * alone.measured_j);
    EXPECT_NEAR(alone.modelled_j, heard.accounts.modelled_j, 1e-6 * alone.measured_j);
  }
}

TEST(SameEnergies, AfterRestarts) {
  for (const Log& log : recordings()) {
    const history::Mission whole = by_daemon(log);
    for (const std::size_t at : {std::size_t{2}, std::size_t{22}, log.samples.size() / 2}) {
      for (const bool killed : {false, true}) {
        SCOPED_TRACE(log.name + (killed ? ", killed before " : ", stopped before ") + std::to_string(at));
        const history::Mission resumed = by_daemon(log, at, killed);
        EXPECT_NEAR(resumed.accounts.measured_j, whole.accounts.measured_j, 1e-6 * whole.accounts.measured_j);
        EXPECT_NEAR(resumed.accounts.duration_s, whole.accounts.duration_s, 1e-6);
        EXPECT_EQ(resumed.gap_count, whole.gap_count);
        EXPECT_EQ(resumed.samples, whole.samples);
      }
    }
  }
}

TEST(SameEnergies, DaemonAndReplayDefaultsAgree) {
  const SessionSettings replay, daemon = settings_of_daemon();
  EXPECT_EQ(replay.meter.gap_bridge_s, daemon.meter.gap_bridge_s);
  EXPECT_EQ(replay.meter.tolerance, daemon.meter.tolerance);
  EXPECT_EQ(replay.reorder_us, daemon.reorder_us);
}

}  // namespace
}  // namespace joulecast::ingest
