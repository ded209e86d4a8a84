#pragma once

#include <array>
#include <functional>
#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "dynamics/drive_model.h"
#include "plausibility/check.h"
#include "plausibility/observation.h"

// The parts of check_recordings, one for each kind of finding.
namespace joulecast::plausibility {

// Interval of a check without one.
inline constexpr std::array<double, 2> no_interval{std::numeric_limits<double>::quiet_NaN(),
                                                   std::numeric_limits<double>::quiet_NaN()};

// Two ratios may be one if their logarithms differ by less.
inline constexpr double same_ratio = 0.2;

// Input of all checks.
struct CheckContext {
  std::span<const Observation> seen;
  const robot::RobotModel& robot;
  const dynamics::DriveModel& model;
  double motor_delay_s = 0;                         // motor_delay(); NaN: unknown
  std::array<ValueTally, reading_count> tallies{};  // of all missions
  std::vector<std::string> silent{};                // channels contradicted so far, not used again

  // True if none of the readings is contradicted.
  bool heard(std::initializer_list<std::size_t> readings) const;
  // True if, in addition, all of them are measured.
  bool has(std::initializer_list<std::size_t> readings) const;
  const ValueTally& tally(std::size_t reading) const { return tallies[reading]; }
  std::vector<Products::Block> blocks(Relation relation) const { return blocks_of(seen, relation); }
  // Median over the missions in which it is above 0; 0 where there is none.
  double usual(const std::function<double(const Observation&)>& of) const;
  double period_s() const {  // between rows
    return usual([](const Observation& o) { return o.clock.period_s(); });
  }
  double moving_s() const;
};

std::vector<Check> check_clock(const CheckContext& c);            // utime, sequence, mission lengths
std::vector<Check> check_silence(const CheckContext& c);          // dead, constant, unsigned channels
std::vector<Check> check_wheels(const CheckContext& c);           // leaps, and a constant factor
std::vector<Check> check_signs_and_units(const CheckContext& c);  // one source against the others
std::vector<Check> check_motors(const CheckContext& c);           // each motor against its sibling
std::vector<Check> check_robot_file(const CheckContext& c);
std::vector<Check> check_limits(const CheckContext& c);
std::vector<Check> check_kinematics(const CheckContext& c);  // gyro and map against wheels
std::vector<Check> check_delays(const CheckContext& c);
std::vector<Check> check_steps(const CheckContext& c);     // lasting changes between missions
std::vector<Check> check_readings(const CheckContext& c);  // held, coarse, clipped, thrown, missing

// Fields with a large share of samples that are left out for implausible readings.
std::vector<Check> check_ranges(const telemetry::RecordingSet& recordings);

// "0.93 (0.91 to 0.95)", or the number alone where it has no interval.
std::string with_interval(double value, const std::array<double, 2>& interval);
Check make_check(std::string id, std::string channel, const Estimate& value, std::string says);

}  // namespace joulecast::plausibility
