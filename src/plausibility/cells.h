#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "plausibility/readings.h"
#include "plausibility/tally.h"
#include "signals/sample.h"
#include "telemetry/recording.h"

namespace joulecast::plausibility {

inline constexpr std::size_t motor_readings = reading::motor_current + 2;

// Means over consecutive rows, over a time long enough for noise and small delays to cancel. NaN: not
// measured. Sides [0] right, [1] left.
struct Cell {
  double length_s = 0;
  std::array<double, reading_count> mean{};  // of each reading; payload 0 where not stated
  std::array<double, 2> acceleration_rad_s2{};
  // Values of the size of the rows' white noise in the means of the speeds, motor voltages and motor currents
  // (the first readings) and in the accelerations, without the motion.
  std::array<double, motor_readings> noise{};
  std::array<double, 2> acceleration_noise{};
  std::array<int, 2> way{};  // +1, -1: direction of the wheel throughout, else 0
  bool resting = false;      // both wheels at rest
  double battery_power_w = 0, motor_power_w = 0;
};

// Cuts a mission's samples into cells; keeps the open one.
class CellCutter {
 public:
  CellCutter(double limit_rad_s, double declared_kg) : limit_rad_s_(limit_rad_s), payload_(declared_kg) {}

  // Returns the cell completed by this sample, if any.
  std::optional<Cell> add(const signals::Sample& sample);

 private:
  struct Sums {
    double t = 0, tt = 0;
    std::array<double, 2> tw{};
    std::array<ValueTally, reading_count> of;
    // The last two rows, and the sum of their second differences with alternating signs.
    std::array<std::array<double, 2>, motor_readings> last{};
    std::array<double, motor_readings> alternating{};
    ValueTally battery_power, motor_power;
    double rows() const { return static_cast<double>(of[reading::wheel_velocity].known()); }
  };
  void take(signals::Sample sample);
  Cell cell() const;

  double limit_rad_s_;
  telemetry::MissionPayload payload_;
  std::int64_t begin_us_ = 0, last_us_ = 0;
  Sums sums_;
};

// A segment of a mission between two positions, some seconds apart.
struct Span {
  double length_s = 0;
  std::array<double, 2> turned_rad{};       // by each wheel
  double gyro_rad = 0;                      // turned, by the gyro; NaN: none
  double heading_rad = 0, heading_deg = 0;  // turned, by the map, read as radians and as degrees
  double forward = 0;                       // moved, by the map, along the mean heading
  double distance = 0;                      // straight
  double begin_rad_s = 0, end_rad_s = 0;    // mean of the wheels at both ends
};

class SpanCutter {
 public:
  std::optional<Span> add(const signals::Sample& sample);

 private:
  void begin(const signals::Sample& sample);

  std::optional<signals::Sample> first_, last_;
  Span span_;
  double heading_sum_ = 0;  // of the turn since the beginning, for the mean heading
  std::size_t rows_ = 0;
};

}  // namespace joulecast::plausibility
