#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/drive_model.h"
#include "plausibility/cells.h"
#include "plausibility/products.h"
#include "plausibility/readings.h"
#include "plausibility/tally.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::plausibility {

// Relations between channels for which an observation keeps Products, with their quantities in order. `sign`:
// direction of a wheel, 0 while it starts or stops. Sides [0] right, [1] left.
enum class Relation : std::size_t {
  armature_right,  // V, i, w, sign, acceleration, 1; the wheel turning
  armature_left,
  armature_difference,  // V, i, w, acceleration: right minus left
  torque_right,         // i, sign, w, common and differential acceleration, side slip, 1; the wheel turning
  torque_left,
  motors,   // battery power, power of both motors, 1
  driving,  // battery power, the model's, 1, battery power plus that of descents, the model's at steady
            // speed and for acceleration, m g v sin(pitch), turning, the model's at half that speed, at
            // steady speed and for acceleration on wheels of double the radius, the same on wheels of half
            // the radius; where the model has no braking
  idle,     // battery power, 1; standing
  motion,   // battery power, the model's, 1
  sag,      // changes of the battery's voltage, of its current, from one cell to the next; the
            // latter again, or 0 unless the model charges the battery in both
  climb,    // battery power less the model's, m g v sin(pitch), 1
  gyro,     // yaw rate, w right, w left, 1
  way,      // speed of the robot by the wheels, its magnitude, 1
  command,  // speed of the right wheel, of the left, of the command, turn commanded
  command_turn,    // turning of the wheels, of the command
  heading_gyro,    // turned by the map in rad, in degrees, by the gyro, time
  heading_wheels,  // turned by the map in rad, in degrees, by the right wheel, by the left
  distance,        // moved by the map, by the wheels
  siblings,        // current of the right motor, of the left, 1; both in the wheels' direction, straight on
  back_emf,        // voltage less the drop over the file's resistance, right, left, 1
  yaw,             // yaw rate, 1; standing too
  commanded,       // battery power, faster wheel's speed commanded, 1
  slip  // moved by the map along the heading, by the wheels, the same turning, braking; speed change
};
inline constexpr std::size_t relation_count = static_cast<std::size_t>(Relation::slip) + 1;

constexpr Relation of_side(Relation right, std::size_t side) {
  return static_cast<Relation>(static_cast<std::size_t>(right) + side);
}

// Leaps that differ less than this share are those of one counter that overflows: its period, plus or minus a
// row's acceleration.
inline constexpr double alike_leaps = 0.8;

// Statistics of one mission, sufficient for every check that needs no delays and no single readings. At most
// some hundred kilobytes, independent of the mission's length.
struct Observation {
  std::string mission_id;
  ClockTally clock;
  std::array<ValueTally, reading_count> values;
  std::array<Products, relation_count> relations;
  std::array<std::uint32_t, relation_count> readings{};  // of each relation, as bits
  double moving_s = 0;                                   // some wheel turning
  double map_moving_s = 0, map_standing_s = 0;           // by the map alone
  double fastest_m_s = 0;                                // of half a second, by the file's wheel radius
  double fastest_turn_rad_s = 0;                         // of half a second, by the gyro
  // Rows in which a wheel's speed or the battery's voltage drops to zero or jumps up, and returns in the next
  // row. Small values are not counted: such steps are frequent in noise about zero.
  std::array<std::size_t, reading_count> spikes{};
  // Steps of a wheel's speed from one row to the next, and not back, that no robot of these limits makes: the
  // number, the smallest and the largest [rad/s].
  std::size_t leaps = 0;
  double least_leap_rad_s = std::numeric_limits<double>::infinity(), farthest_leap_rad_s = 0;
};

// The drive with the effects that the catalogue accepts.
dynamics::DriveModel drive_of(const robot::RobotModel& robot);

// Builds an observation from a mission's samples, one by one. Work and memory per sample do not grow.
class Observer {
 public:
  // `drive`: of that robot.
  Observer(const robot::RobotModel& robot, const dynamics::DriveModel& drive);

  void begin(std::string mission_id, double declared_payload_kg);
  void add(const signals::Sample& sample);
  Observation finish();
  // The result of finish() at this point, except for the last sample; the mission continues.
  Observation so_far() const;

 private:
  bool leaps(double from_rad_s, double to_rad_s, std::int64_t elapsed_us) const;
  void repair(signals::Sample& sample, const signals::Sample& after);
  void take(signals::Sample sample);
  void take(const Cell& cell);
  void take_power(const Cell& cell);
  void take(const Span& span);
  void relate(Relation relation, std::initializer_list<std::size_t> readings,
              std::initializer_list<double> row,
              std::initializer_list<std::initializer_list<double>> noise = {});

  robot::RobotModel robot_;
  dynamics::DriveModel model_, larger_, smaller_;  // on wheels of double and of half the radius
  double limit_rad_s_;
  Observation seen_;
  std::optional<CellCutter> cells_;
  SpanCutter spans_;
  std::size_t cells_in_block_ = 0;
  std::array<double, 3> battery_{};  // voltage, current, power by the model; of the last cell
  std::optional<signals::Sample> before_,
      waiting_;                // a spike is detected from the next sample
  signals::Sample known_;      // last measured position and yaw rate ...
  std::int64_t known_us_ = 0;  // ... and their time
};

Observation observe(const telemetry::Recording& mission, const robot::RobotModel& robot,
                    const dynamics::DriveModel& drive);

// Blocks of one relation over all missions; neighbours are merged where there are many. Empty where one of
// its readings is in `silent`, as bits.
std::vector<Products::Block> blocks_of(std::span<const Observation> observations, Relation relation,
                                       std::uint32_t silent = 0);

}  // namespace joulecast::plausibility
