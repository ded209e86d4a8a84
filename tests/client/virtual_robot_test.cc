#include "client/virtual_robot/virtual_robot.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "signals/sample.h"
#include "telemetry/codec.h"
#include "tests/client/robots.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::virtual_robot {
namespace {

SimulationSpec noisy_spec(std::string_view kind, int missions = 2) {
  SimulationSpec spec;
  spec.robot = shipped(kind);
  spec.missions = missions;
  spec.sensors.sampling_jitter = 0.1;
  spec.sensors.loss_probability = 0.01;
  spec.script.pickup_share = 0.5;
  return spec;
}

// The encoded messages, so that NaN compares bit by bit.
std::vector<std::vector<std::uint8_t>> encoded(const Simulation& run) {
  std::vector<std::vector<std::uint8_t>> bytes;
  for (const auto& sample : run.samples) bytes.push_back(telemetry::encode_telemetry("r", sample).value());
  for (const auto& event : run.events) bytes.push_back(telemetry::encode_mission_event("r", event).value());
  return bytes;
}

TEST(VirtualRobot, SeedDeterminesMissions) {
  const SimulationSpec spec = noisy_spec("nomad");
  const auto first = encoded(simulate_missions(spec, 42));
  EXPECT_EQ(first, encoded(simulate_missions(spec, 42)));
  EXPECT_NE(first, encoded(simulate_missions(spec, 43)));
}

TEST(VirtualRobot, MissionsStayInsideWalls) {
  for (const char* kind : {"amr", "nomad", "tug", "p3dx"}) {
    const SimulationSpec spec = noisy_spec(kind, 3);
    const Simulation run = simulate_missions(spec, 5);
    ASSERT_EQ(run.events.size(), 6u);
    for (std::size_t k = 0; k < 6; ++k) {
      EXPECT_EQ(run.events[k].phase,
                k % 2 == 0 ? signals::MissionPhase::started : signals::MissionPhase::finished);
      EXPECT_EQ(run.events[k].mission_id, run.truth.missions[k / 2].mission_id);
    }
    for (const auto& sample : run.samples) {
      // Six standard deviations of 1 cm.
      ASSERT_LT(std::abs(sample.pose[0]), spec.script.map_half_width_m + 0.06);
      ASSERT_LT(std::abs(sample.pose[1]), spec.script.map_half_width_m + 0.06);
    }
    for (const auto& mission : run.truth.missions) {
      EXPECT_GT(mission.duration_s, spec.script.duration_s);
      EXPECT_GT(mission.distance_m, 10);
    }
  }
}

TEST(VirtualRobot, SequenceCountsLostSamples) {
  const SimulationSpec spec = noisy_spec("amr");
  const Simulation run = simulate_missions(spec, 8);
  const auto& samples = run.samples;
  const auto sent = static_cast<double>(samples.back().sequence + 1);
  const double lost = sent - static_cast<double>(samples.size());
  // Binomial: mean n p, five standard deviations to either side.
  EXPECT_NEAR(lost, 0.01 * sent, 5 * std::sqrt(0.01 * 0.99 * sent));
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const auto steps = static_cast<double>(samples[k].sequence - samples[k - 1].sequence);
    ASSERT_GE(steps, 1);
    // Jitter of a tenth of 20 ms to either side at both ends, and half an integration step of rounding at
    // both.
    ASSERT_NEAR(static_cast<double>(samples[k].utime_us - samples[k - 1].utime_us), 20'000 * steps,
                4'000 + 501);
  }
}

TEST(VirtualRobot, AppliesSensorConfiguration) {
  SimulationSpec spec = noisy_spec("amr", 1);
  spec.sensors.gyro = false;
  spec.sensors.temperature = true;
  const Simulation run = simulate_missions(spec, 4);
  for (const auto& s : run.samples) {
    const double steps = s.wheel_velocity_rad_s[0] / spec.sensors.encoder_step_rad_s;
    ASSERT_NEAR(steps, std::round(steps), 1e-9);
    ASSERT_TRUE(std::isnan(s.yaw_rate_rad_s));
    ASSERT_TRUE(std::isnan(s.pitch_rad));
    ASSERT_TRUE(std::isfinite(s.motor_temperature_c[0]));
    ASSERT_TRUE(std::isfinite(s.motor_voltage_v[1]));
  }

  spec.sensors.motor_channels = false;
  const Simulation without = simulate_missions(spec, 4);
  EXPECT_TRUE(std::isnan(without.samples[10].motor_voltage_v[0]));
  EXPECT_TRUE(std::isnan(without.samples[10].motor_current_a[1]));
  EXPECT_TRUE(std::isfinite(without.samples[10].battery_current_a));
}

TEST(VirtualRobot, NoiseHasStatedDeviation) {
  SimulationSpec spec = noisy_spec("amr", 2);
  spec.sensors.loss_probability = 0;
  spec.sensors.sampling_jitter = 0;
  SimulationSpec clean = spec;
  clean.sensors.noise = false;
  const Simulation noisy = simulate_missions(spec, 4);
  const Simulation exact = simulate_missions(clean, 4);
  ASSERT_EQ(noisy.samples.size(), exact.samples.size());
  double square = 0;
  for (std::size_t k = 0; k < noisy.samples.size(); ++k) {
    const double error = noisy.samples[k].battery_current_a - exact.samples[k].battery_current_a;
    square += error * error;
  }
  const auto count = static_cast<double>(noisy.samples.size());
  // A standard deviation estimated from n normal draws is normal with sd / sqrt(2 n); five of those.
  EXPECT_NEAR(std::sqrt(square / count), spec.sensors.battery_current_noise_a,
              5 * spec.sensors.battery_current_noise_a / std::sqrt(2 * count));
}

TEST(VirtualRobot, BatteryBalancesDrivesAndLoads) {
  SimulationSpec spec = noisy_spec("tug");
  spec.scatter = 0;
  spec.imperfections.accessory_load = 11;
  const Simulation run = simulate_missions(spec, 6);
  for (const auto& mission : run.truth.missions) {
    const double expected = mission.accounts.bus + (spec.robot.idle_power_w + 11) * mission.duration_s;
    EXPECT_NEAR(mission.battery_energy_j / expected, 1, 1e-9);
  }
}

TEST(VirtualRobot, NominalPlantMatchesRobotFile) {
  // Inductance, bristles and control steps contribute below 1 % of power, as in recordings of other plants.
  for (const char* kind : {"amr", "nomad", "tug", "p3dx"}) {
    EXPECT_LT(power_gap(noisy_spec(kind), 9).absolute, 0.01) << kind;
  }
}

TEST(VirtualRobot, BeginsWithTheGivenCharge) {
  SimulationSpec spec = noisy_spec("amr");
  spec.initial_charge = 0.1;
  const Simulation run = simulate_missions(spec, 3);
  EXPECT_EQ(run.truth.missions[0].charge_at_start, 0.1);
  EXPECT_GT(run.truth.missions[1].charge_at_start, 0.25);  // exchanged between missions
}

TEST(VirtualRobot, PickupsChangeDeclaredPayload) {
  SimulationSpec spec = noisy_spec("amr", 4);
  spec.script.pickup_share = 1;
  const Simulation run = simulate_missions(spec, 2);
  int changes = 0;
  for (std::size_t k = 1; k < run.samples.size(); ++k) {
    changes += run.samples[k].payload_kg != run.samples[k - 1].payload_kg ? 1 : 0;
  }
  EXPECT_GT(changes, 4);
}

TEST(Fleet, OrdersMessagesAndAbortsMissions) {
  std::vector<SimulationSpec> specs{noisy_spec("amr", 0), noisy_spec("nomad", 0), noisy_spec("p3dx", 0)};
  Fleet fleet(specs, 1);
  std::int64_t last_us = std::numeric_limits<std::int64_t>::min();
  std::array<std::int64_t, 3> last_of{};
  for (int k = 0; k < 5000; ++k) {
    const auto message = fleet.next();
    ASSERT_TRUE(message);
    ASSERT_GE(message->emission.utime_us, last_us);
    last_us = message->emission.utime_us;
    last_of[message->robot] = last_us;
  }
  const auto ends = fleet.abort();
  ASSERT_EQ(ends.size(), 3u);
  for (const auto& end : ends) {
    const auto& event = std::get<signals::MissionEvent>(end.emission.message);
    EXPECT_EQ(event.phase, signals::MissionPhase::aborted);
    EXPECT_EQ(event.utime_us, last_of[end.robot]);
  }
  EXPECT_FALSE(fleet.next());
}

}  // namespace
}  // namespace joulecast::virtual_robot
