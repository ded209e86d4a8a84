#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/drive_model.h"
#include "plausibility/cells.h"
#include "plausibility/delays.h"
#include "plausibility/products.h"
#include "plausibility/readings.h"
#include "plausibility/tally.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::plausibility {

// Relations between channels for which an observation keeps Products, with their quantities in order. `sign`:
// direction of a wheel, 0 while it starts or stops. Sides [0] right, [1] left.
enum class Relation : std::size_t {
  armature_right,  // V, i, w, sign, acceleration; the wheel turning
  armature_left,
  armature_difference,  // V, i, w, acceleration: right minus left
  torque_right,         // i, sign, w, common and differential acceleration, side slip; the wheel turning
  torque_left,
  ways_right,  // i, V, 1 forward, 1 backward
  ways_left,
  motors,          // battery power, power of both motors, 1
  driving,         // battery power, the model's, 1, battery power plus that of descents; where the
                   // model has no braking
  motion,          // battery power, the model's without the idle power, 1
  idle,            // battery power, 1; standing
  climb,           // battery power less the model's, m g v sin(pitch), 1
  gyro,            // yaw rate, w right, w left, 1
  way,             // speed of the robot by the wheels, its magnitude, 1
  command,         // speed of the right wheel, of the left, of the command, turn commanded
  command_turn,    // turning of the wheels, of the command
  heading_gyro,    // turned by the map in rad, in degrees, by the gyro, time
  heading_wheels,  // turned by the map in rad, in degrees, by the right wheel, by the left
  travel,          // moved by the map along and across the heading, turned by the wheels
  distance,        // moved by the map, by the wheels
  siblings,        // current of the right motor, of the left, 1; both in the wheels' direction, straight on
  back_emf,        // voltage less the drop over the file's resistance, right, left, 1
  yaw,             // yaw rate, 1; standing too
  commanded,       // battery power, faster wheel's speed commanded, 1
  slip  // moved by the map along the heading, by the wheels, the same turning, braking; speed change
};
inline constexpr std::size_t relation_count = static_cast<std::size_t>(Relation::slip) + 1;

// Statistics of one mission, sufficient for every check. At most some hundred kilobytes, independent of the
// mission's length.
struct Observation {
  std::string mission_id;
  ClockTally clock;
  std::array<ValueTally, reading_count> values;
  std::array<Products, relation_count> relations;
  LagSums lags;
  double moving_s = 0;                          // some wheel turning
  double map_moving_s = 0, map_standing_s = 0;  // by the map alone
  double fastest_m_s = 0;                       // of half a second, by the file's wheel radius
  double fastest_turn_rad_s = 0;                // of half a second, by the gyro
  // Steps of a wheel's speed from one row to the next, and not back, that no robot of these limits makes: the
  // number, the smallest and the largest [rad/s].
  std::size_t leaps = 0;
  double least_leap_rad_s = std::numeric_limits<double>::infinity(), farthest_leap_rad_s = 0;

  const ValueTally& of(std::size_t reading) const { return values[reading]; }
  const Products& of(Relation r) const { return relations[static_cast<std::size_t>(r)]; }
};

// Builds an observation from a mission's samples, one by one. Work and memory per sample do not grow.
class Observer {
 public:
  // `drive`: of that robot. Without `delays` the lags stay empty, which saves most of the work per sample.
  Observer(const robot::RobotModel& robot, const dynamics::DriveModel& drive, bool delays = true);

  void begin(std::string mission_id, double declared_payload_kg);
  void add(const signals::Sample& sample);
  Observation finish();
  // The result of finish() at this point, except for the last sample; the mission continues.
  Observation so_far() const;

 private:
  void take(signals::Sample sample);
  void take(const Cell& cell);
  void take_power(const Cell& cell);
  void take(const Span& span);
  Products& of(Relation r) { return seen_.relations[static_cast<std::size_t>(r)]; }

  bool leaps(double from_rad_s, double to_rad_s, std::int64_t elapsed_us) const;

  robot::RobotModel robot_;
  dynamics::DriveModel model_;
  double limit_rad_s_;
  bool delays_;
  Observation seen_;
  std::optional<CellCutter> cells_;
  SpanCutter spans_;
  std::size_t cells_in_block_ = 0;
  std::optional<signals::Sample> before_, waiting_;  // a spike is detected from the next sample
  signals::Sample known_;                            // last measured position and yaw rate ...
  std::int64_t known_us_ = 0;                        // ... and their time
};

// Blocks of one relation over all missions; neighbours are merged where there are many.
std::vector<Products::Block> blocks_of(std::span<const Observation> observations, Relation relation);

// Lag of channels behind the wheel speeds.
std::optional<Delay> delay_of(std::span<const Observation> observations, std::span<const Late> channels);
// Smallest delay that is accepted as one: a row and a half, plus half of the time for which these readings or
// the wheel speeds are held.
double least_delay_s(std::span<const Observation> observations, std::initializer_list<std::size_t> readings);

Observation observe(const telemetry::Recording& mission, const robot::RobotModel& robot,
                    const dynamics::DriveModel& drive);

}  // namespace joulecast::plausibility
