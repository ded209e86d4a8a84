#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "client/virtual_robot/virtual_robot.h"
#include "signals/mission_event.h"
#include "signals/sample.h"

namespace joulecast::virtual_robot {

// The gap that a set of imperfections makes: integral of |P_measured - P_nominal| over that of |P_measured|,
// battery power, by the robot file's model from the true motion, without noise or scatter between missions.
struct PowerGap {
  double absolute = 0;  // with the imperfections
  double base = 0;      // without: caused by inductance, bristles and the like alone
  double energy = 0;    // (E_measured - E_nominal) / E_measured with the imperfections
  double added() const { return absolute - base; }
};

struct Truth {
  std::string robot_id;
  std::uint64_t seed = 0;
  std::vector<EffectStrength> effects;
  World world;
  std::vector<MissionTruth> missions;
};

struct Simulation {
  std::vector<signals::MissionEvent> events;
  std::vector<signals::Sample> samples;  // in order of time
  std::vector<signals::CovariateMessage> covariates;
  Truth truth;
};

// All missions of the spec; spec.missions > 0.
[[nodiscard]] Simulation simulate_missions(const SimulationSpec& spec, std::uint64_t seed);

// Power that the robot file alone expects at the battery for this motion: thesis (2-45) with the full
// cross-coupling, without inductance, all braking power returned, plus idle power.
[[nodiscard]] double nominal_power_w(const RobotParameters& robot,
                                     const std::array<double, 2>& wheel_speed_rad_s,
                                     const std::array<double, 2>& wheel_acceleration_rad_s2,
                                     double payload_kg);

[[nodiscard]] PowerGap power_gap(const SimulationSpec& spec, std::uint64_t seed);
// PowerGap::absolute alone, at half the work.
[[nodiscard]] double absolute_power_gap(const SimulationSpec& spec, std::uint64_t seed);

// The strength of one effect with a given sign (+1, -1) for which the spec's other imperfections and this one
// together have a gap larger by `added_gap` than without it. Fault::infeasible, naming the largest possible
// gap, when the effect cannot reach it (some barely affect battery power: kinematics, battery resistance).
[[nodiscard]] Result<double> strength_for_gap(const SimulationSpec& spec, std::uint64_t seed,
                                              std::string_view effect_id, double added_gap, double sign = 1);

// The injected truth as JSON: per robot its effects with strengths, the world's shapes, and per
// mission the true energies [J].
[[nodiscard]] std::string truth_json(const std::vector<Truth>& truths);

}  // namespace joulecast::virtual_robot
