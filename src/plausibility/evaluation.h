#pragma once

#include <fmt/format.h>

#include <array>
#include <functional>
#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "dynamics/drive_model.h"
#include "plausibility/check.h"
#include "plausibility/motors.h"
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
  double motor_delay_s = 0;                // motor_delay(); NaN: unknown
  std::array<MotorConstants, 2> motors{};  // of all missions, as the next
  std::array<ValueTally, reading_count> tallies{};
  std::vector<std::string> silent{};  // channels contradicted so far, not used again

  // True if none of the readings is contradicted.
  bool heard(std::initializer_list<std::size_t> readings) const;
  // True if, in addition, all of them are measured.
  bool has(std::initializer_list<std::size_t> readings) const;
  const ValueTally& tally(std::size_t reading) const { return tallies[reading]; }
  std::vector<Products::Block> blocks(Relation relation) const { return blocks_of(seen, relation); }
  // Median over the missions in which it is above 0; 0 without such a mission.
  double usual(const std::function<double(const Observation&)>& of) const;
  double period_s() const {  // between rows
    return usual([](const Observation& o) { return o.clock.period_s(); });
  }
  double moving_s() const;
  // A motor's current at steady speed over that of the file's friction; unknown without friction.
  Estimate friction_ratio(std::size_t side) const;
};

// Each adds its findings.
using Checks = std::vector<Check>;
void check_clock(const CheckContext& c, Checks& checks);            // utime, sequence, mission lengths
void check_silence(const CheckContext& c, Checks& checks);          // dead, constant, unsigned channels
void check_wheels(const CheckContext& c, Checks& checks);           // leaps, and a constant factor
void check_signs_and_units(const CheckContext& c, Checks& checks);  // one source against the others
void check_motors(const CheckContext& c, Checks& checks);           // each motor against its sibling
void check_robot_file(const CheckContext& c, Checks& checks);
void check_limits(const CheckContext& c, Checks& checks);
void check_kinematics(const CheckContext& c, Checks& checks);  // gyro and map against wheels
void check_delays(const CheckContext& c, Checks& checks);
void check_steps(const CheckContext& c, Checks& checks);     // lasting changes between missions
void check_readings(const CheckContext& c, Checks& checks);  // held, coarse, clipped, thrown, missing

// Fields with a large share of samples that are left out for implausible readings.
std::vector<Check> check_ranges(const telemetry::RecordingSet& recordings);

// "0.93 (0.91 to 0.95)", or the number alone where it has no interval.
std::string with_interval(double value, const std::array<double, 2>& interval);
Check make_check(std::string id, std::string channel, const Estimate& value, std::string says);

// Adds a finding without an interval of its value.
template <class... Args>
Check& add_check(Checks& checks, std::string id, std::string channel, double value, bool contradicted,
                 fmt::format_string<Args...> says, Args&&... args) {
  checks.push_back({std::move(id), std::move(channel), value, no_interval,
                    fmt::format(says, std::forward<Args>(args)...), contradicted});
  return checks.back();
}

}  // namespace joulecast::plausibility
