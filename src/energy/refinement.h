#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>

#include "energy/drive_equations.h"
#include "robot/robot_model.h"

namespace joulecast::energy {

// Uncertainty of the robot file, scatter of missions, and drift of a robot; standard deviations.
//
// No fleet has been measured for them: unless a line names its source they are assumed, on the wide side of
// the distributions of the virtual robots of client/virtual_robot. They are scales: the scatter between
// missions is multiplied by a factor that is estimated from the missions (0.1 to 30), the file's share
// vanishes after some missions, and a test checks that half or twice all of them changes no conclusion
// (WrongTrustKeepsConclusions).
struct RefinementTrust {
  double file_friction = 0.15;  // of the friction torque
  double file_viscous = 0.5;    // of the viscous friction, and at least that of the dry one at top speed / 10
  double file_idle = 0.1;       // of the idle power
  double file_mass = 0.03;      // of the total mass
  double file_battery = 0.5;    // of the battery's resistance: cold against warm, new against aged
  // Between missions of an unchanged robot (floor, grease, temperature).
  double scatter_common = 0.03;  // of the friction torque, common to both sides
  double scatter_side = 0.015;   // ... each side on its own
  double scatter_viscous = 0.05;
  double scatter_idle = 0.015;
  double scatter_mass = 0.003;    // of the total mass: load that is never declared, such as cables and dirt
  double scatter_battery = 0.05;  // of the battery's resistance: charge and temperature
  double memory_missions = 50;    // over which a robot drifts by one scatter
  // Other effects on a mission.
  double slope_rad = 0.004;  // flatness of finished floors: 4 mm over 1 m (DIN 18202, table 3, line 3)
  double scrub = 0.01;
  double yaw_inertia = 0.05;
  double current_bias = 0.002;  // of the current limit
  double driver_loss = 0.03;
  // Of the whole accelerated inertia, wheels and rotors included: currents that are sampled in step with the
  // motor controller differ from their mean while the speed changes, by up to half its period over the
  // motor's mechanical time constant, in the same way at every acceleration, so that no number of missions
  // averages it out.
  double inertia_scale = 0.02;
  // Payload.
  double payload_wide = 1.5;    // of the payload limit: possible undeclared load
  double payload_least = 0.05;  // of the payload limit: less is not worth an event
  double payload_scale = 0.02;  // of all that is carried: error of the torque constant, load-borne friction
  // Deviations from which a payload is undeclared. 3.3 reported 3 of 320 missions of small robots without a
  // load at 10 Hz, one or two a day of a fleet; 5 report none of these and find 80 of 81 loads of the tests.
  double payload_certain = 5;
};

struct Estimate {
  double value = 0;
  double sd = 0;
};

// The values of a robot file that are refined, in the order of Unknown.
std::array<double, refined_count> refined_values(const robot::RobotModel& robot);

struct MissionFinding {
  std::size_t equations = 0;
  bool enough = false;  // for a finding
  // Load beyond the declared payload; the deviation includes the uncertainty from friction, slope, the
  // robot's own mass and the sensors.
  Estimate undeclared_kg;
  bool undeclared = false;   // a significant deviation that is reported
  bool inseparable = false;  // payload cannot be separated from the rest: deviation above half the limit
  std::array<Estimate, refined_count> parameters;  // of this mission, absolute, its payload as declared
  double torque_rms_nm = 0;                        // residual, NaN without motor currents
  double surprise = 0;  // squared distance from the expectation over its dimension; 1 is usual
};

// The parameters of one mission alone, its payload as declared.
struct MissionParameters {
  std::int64_t utime_us = 0;  // its start
  double declared_kg = 0;
  std::array<double, refined_count> value{};
  std::array<double, refined_count * refined_count> covariance{};
};

// Friction, idle power, mass and battery resistance of one robot by its newest missions: a Kalman filter over
// missions from the robot file on, each of which enters as one measurement with its own covariance plus the
// scatter between missions, under a slow drift of the robot. Values are absolute, so that a new model version
// does not disturb them. Load that a mission did not declare is what its mass departs by, beyond chance.
class Refinement {
 public:
  static constexpr std::size_t most_missions = 30;  // kept

  explicit Refinement(const robot::RobotModel& robot, const RefinementTrust& trust = {});

  // Call when a model version with other parameters comes into force; the missions are kept.
  void rebase(const robot::RobotModel& robot);

  // The robot changed: forgets missions that began earlier. After a change of its mass the file's mass is
  // no longer expected.
  void restart(std::int64_t since_utime_us, bool mass_changed);

  // Evaluates a mission that began at `utime_us` (its equations were made with the model in force) with a
  // mean declared payload of `declared_kg`. With `learn` its parameters enter the estimate; without, they are
  // left for tests of it.
  MissionFinding judge(std::span<const DriveEquation> equations, double declared_kg, std::int64_t utime_us,
                       bool learn);

  std::size_t missions() const { return learned_.size(); }  // learned from
  // Absolute values, in the order of Unknown; the mass's deviation contains the trust's inertia_scale.
  std::array<Estimate, refined_count> estimates() const;
  double scatter_factor() const { return scatter_factor_; }  // of the trust's scatter, as missions show it

  // The robot with those parameters in it that depart from the model in force by `departing` standard
  // deviations, the others being as in force.
  robot::RobotModel refined(double departing) const;
  // The greatest departure from the model in force, in standard deviations.
  double significance() const;

  struct Memory {
    std::deque<MissionParameters> learned;
    bool mass_changed = false;
  };
  Memory memory() const { return {learned_, mass_changed_}; }
  bool recall(Memory memory);  // false when it is none

 private:
  MissionFinding step(const MissionParameters& mission, bool learn);
  void relearn();
  double with_inertia_scale(double mass_sd_kg) const;

  robot::RobotModel robot_;
  RefinementTrust trust_;
  std::deque<MissionParameters> learned_;
  bool mass_changed_ = false;
  std::array<double, refined_count> mean_{};
  std::array<double, refined_count * refined_count> covariance_{};
  double scatter_factor_ = 1;
  std::size_t steps_ = 0;  // of the filter
};

}  // namespace joulecast::energy
