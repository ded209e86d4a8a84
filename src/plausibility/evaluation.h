#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/drive_model.h"
#include "plausibility/check.h"
#include "plausibility/delays.h"
#include "plausibility/observation.h"

// The parts of check_recordings, one for each kind of finding.
namespace joulecast::plausibility {

// Two ratios may be one if their logarithms differ by less.
inline constexpr double same_ratio = 0.2;

struct ChannelEvidence;

// Input of all checks.
struct CheckContext {
  // Without `recordings` there are no delays and no single readings.
  CheckContext(std::span<const Observation> observations, const robot::RobotModel& of,
               const dynamics::DriveModel& drive, std::span<const telemetry::Recording> recordings = {});

  std::span<const Observation> seen;
  const robot::RobotModel& robot;
  const dynamics::DriveModel& model;
  std::span<const telemetry::Recording> missions;
  Lags lags;
  std::array<ValueTally, reading_count> tallies{};
  std::uint32_t silent = 0;  // readings contradicted so far, as bits; not used again
  mutable std::shared_ptr<const std::vector<ChannelEvidence>> evidence;  // evidence_of() those not silent
  // Usual time between new readings of a channel that is repeated in the rows between; 0 where each row has a
  // new one, or it is not known.
  std::array<double, reading_count> held_s{};
  double motor_delay_s;  // motor_delay(); NaN: unknown

  // True if none of the readings is contradicted.
  bool heard(std::initializer_list<std::size_t> readings) const {
    return std::ranges::none_of(readings, [&](std::size_t k) { return (silent >> k & 1) != 0; });
  }
  const ValueTally& tally(std::size_t reading) const { return tallies[reading]; }
  std::vector<Products::Block> blocks(Relation relation) const { return blocks_of(seen, relation, silent); }
  Estimate coefficient(Relation relation, Eigen::Index y, const std::vector<Eigen::Index>& x) const {
    return estimate(fit_blocks(blocks(relation), y, x), 0);
  }
  Estimate ratio(Relation relation, Eigen::Index y, Eigen::Index x, Eigen::Index one) const {
    return ratio_of_sums(blocks(relation), y, x, one);
  }
  // Median over the missions in which it is above 0; 0 without such a mission.
  double usual(const std::function<double(const Observation&)>& of) const;
  double sum(const std::function<double(const Observation&)>& of) const;
  double period_s() const {  // between rows
    return usual([](const Observation& o) { return o.clock.period_s(); });
  }
};

// Each adds its findings.
using Checks = std::vector<Check>;
// Utime, sequence, mission lengths.
void check_clock(const CheckContext& c, Checks& checks);
// Dead, constant, unsigned channels.
void check_silence(const CheckContext& c, Checks& checks);
// Wheel speeds of a counter that overflows.
void check_leaps(const CheckContext& c, Checks& checks);
// Signs, units, factors and sides.
void check_faults(const CheckContext& c, Checks& checks);
// Speeds beyond the file's limits.
void check_limits(const CheckContext& c, Checks& checks);
// Each motor against its sibling.
void check_motors(const CheckContext& c, Checks& checks);
// Ratios far from the file's.
void check_robot_file(const CheckContext& c, Checks& checks);
// Gyro and map against wheels.
void check_kinematics(const CheckContext& c, Checks& checks);
void check_delays(const CheckContext& c, Checks& checks);
// Lasting changes between missions.
void check_steps(const CheckContext& c, Checks& checks);
// Readings that jump for a single row.
void check_spikes(const CheckContext& c, Checks& checks);
// Held, missing.
void check_readings(const CheckContext& c, Checks& checks);

// Fields with a large share of samples that are left out for implausible readings.
std::vector<Check> check_ranges(const telemetry::RecordingSet& recordings);

std::array<double, reading_count> held_times(std::span<const telemetry::Recording> missions, double row_s);

// Lag of the motor currents behind the wheel speeds, if its whole interval exceeds that of rows and held
// readings. Leading currents are not a delay: currents lead at every start, as contacts bend and gears wind
// up.
std::optional<Delay> motor_delay(const CheckContext& c);

// "0.93 (0.91 to 0.95)", or the number alone where it has no interval.
std::string with_interval(double value, const std::array<double, 2>& interval);
inline std::string with_interval(const Estimate& e) {
  return with_interval(e.value, e.interval());
}

// Adds a finding; {x} is a value without an interval.
template <class... Args>
Check& add_check(Checks& checks, std::string id, std::string channel, const Estimate& value,
                 bool contradicted, fmt::format_string<Args...> says, Args&&... args) {
  checks.push_back({std::move(id), std::move(channel), value.value, value.interval(),
                    fmt::format(says, std::forward<Args>(args)...), contradicted});
  return checks.back();
}

}  // namespace joulecast::plausibility
