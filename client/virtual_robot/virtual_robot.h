#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "client/virtual_robot/imperfections.h"
#include "client/virtual_robot/mission_script.h"
#include "client/virtual_robot/pilot.h"
#include "client/virtual_robot/plant.h"
#include "client/virtual_robot/robot_parameters.h"
#include "client/virtual_robot/sensors.h"
#include "signals/covariates.h"
#include "signals/sample.h"

namespace joulecast::virtual_robot {

// A charger between missions: constant current, then the voltage of the full pack, until the current has died
// away. The robot stands at it, without a mission, and goes on publishing.
struct Charger {
  double below = 0;         // charge under which a robot goes there; 0: packs are exchanged instead
  double rate_per_h = 0.5;  // of the capacity: the constant current
  double end_per_h = 0.04;  // of the capacity: the current at which it ends
  double rest_after_s = 5;  // at the charger when it has ended
};

struct SimulationSpec {
  RobotParameters robot;
  Imperfections imperfections;
  World world;
  SensorSuite sensors;
  ControllerTuning controller;
  ScriptOptions script;
  Charger charger;
  bool smooth_ramps = false;  // commands without jumps of acceleration
  double settle_s = 0.4;      // at rest between legs
  double latency_s = 0;       // of every electrical channel, in addition to the effect sensor_delay
  double rate_hz = 50;        // of telemetry
  int missions = 5;           // 0: one after another without end
  double scatter = 1;         // size of the differences between missions; 0: none, 1: 1 to 2 % of energy
  double initial_charge = 0.8;
  std::int64_t start_utime_us = 1'700'000'000'000'000;
  std::string run;  // in the missions' ids, to distinguish them from another run's; may be empty
};

// The true course of one mission, without sensors.
struct MissionTruth {
  std::string mission_id;
  double payload_kg = 0;     // declared at the start
  double undeclared_kg = 0;  // carried in addition to the declared payload
  double duration_s = 0;
  double distance_m = 0;
  double battery_energy_j = 0;
  PlantAccounts accounts;  // of this mission
  MissionScatter scatter;
  ScriptPose start;      // planned, where the script begins
  MissionScript script;  // as planned
  double charge_at_start = 0, charge_at_end = 0;
};

struct Emission {
  std::int64_t utime_us = 0;
  std::variant<signals::MissionEvent, signals::Sample, signals::CovariateMessage> message;
};

// Noise-free values at the instant of the last sample, systematic sensor errors included.
struct Witness {
  Reading reading;
  std::array<double, 2> wheel_acceleration_rad_s2{};
};

// One robot at work: pilot, controller, plant, battery and sensors on one clock. Each call runs to its next
// message, in real time and in batches. The same spec and seed give the same messages, bit for bit.
class VirtualRobot {
 public:
  VirtualRobot(const SimulationSpec& spec, std::uint64_t seed);

  // Runs to the next message. Empty when the last mission is over.
  std::optional<Emission> next();

  const Witness& witness() const { return witness_; }
  // Missions that are over, in order.
  const std::vector<MissionTruth>& finished() const { return finished_; }
  const std::string& robot_id() const { return spec_.robot.robot_id; }
  const Plant& plant() const { return plant_; }
  double state_of_charge() const { return pack_.state_of_charge(); }

 private:
  static constexpr std::size_t history_length = 128;  // control periods; longer than any sensor delay

  void run_period();
  void start_mission();
  void finish_mission();
  void take_what_is_due();
  void take_sample();
  void publish_covariates();
  void wander_load();
  double load_power_w() const;
  double battery_power_w() const;  // out of the pack
  bool wants_charging() const;
  void run_charger();
  Electrical electrical() const;
  Electrical delayed(double delay_s) const;
  Reading reading() const;
  std::int64_t now_us() const;
  double sample_time_s(std::int64_t index);

  SimulationSpec spec_;
  Rng mission_rng_;
  Rng scatter_rng_;
  Rng computer_rng_;
  Plant plant_;
  Pack pack_;
  SpeedController controller_;
  Pilot pilot_;
  Sensors sensors_;
  ScriptPose planned_pose_;
  std::deque<Emission> outbox_;
  std::vector<MissionTruth> finished_;
  MissionTruth mission_;
  PlantAccounts accounts_at_start_;
  Witness witness_;
  BodyCommand command_;
  std::array<double, 2> voltage_v_{};
  std::array<double, 2> winding_rise_k_{};
  std::array<Electrical, history_length> history_{};
  std::int64_t step_ = 0;  // integration steps since the beginning
  int steps_per_period_ = 1;
  double step_s_ = 0;
  std::int64_t period_ = 0;  // control periods since the beginning
  std::int64_t sample_index_ = 0;
  double next_sample_s_ = 0;
  std::int64_t covariate_index_ = 0;
  double cpu_load_ = 0.4;
  int missions_begun_ = 0;
  bool under_way_ = false;
  bool charging_ = false;  // at the charger
  double rested_s_ = 0;    // there, after it has ended
};

struct Truth {
  std::string robot_id;
  std::uint64_t seed = 0;
  std::vector<EffectStrength> effects;
  World world;
  std::vector<MissionTruth> missions;
};

// The injected truth as JSON: per robot its effects, the world's shapes, and true energies per mission [J].
[[nodiscard]] std::string truth_json(const std::vector<Truth>& truths);

}  // namespace joulecast::virtual_robot
