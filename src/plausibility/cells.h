#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "plausibility/readings.h"
#include "signals/sample.h"
#include "telemetry/payload.h"

namespace joulecast::plausibility {

// Means over consecutive rows, over a time long enough for noise and small delays to cancel. NaN: not
// measured. Sides [0] right, [1] left.
struct Cell {
  double length_s = 0;
  std::array<double, 2> speed_rad_s{}, acceleration_rad_s2{};
  std::array<int, 2> way{};  // +1, -1: direction of the wheel throughout, else 0
  bool resting = false;      // both wheels at rest
  std::array<double, 2> voltage_v{}, current_a{};
  double battery_voltage_v = 0, battery_current_a = 0, battery_power_w = 0;
  double motor_power_w = 0;  // of both
  double yaw_rate_rad_s = 0, pitch_rad = 0;
  std::array<double, 2> command{};
  double payload_kg = 0;  // 0 where not stated
};

// Cuts a mission's samples into cells; keeps the open one.
class CellCutter {
 public:
  CellCutter(double limit_rad_s, double declared_kg) : limit_rad_s_(limit_rad_s), payload_(declared_kg) {}

  // Returns the cell completed by this sample, if any.
  std::optional<Cell> add(const signals::Sample& sample);

 private:
  struct Mean {
    double sum = 0;
    std::size_t count = 0;
    void add(double value);
    double get(double instead) const;  // `instead` without a value
  };
  struct Sums {
    std::size_t rows = 0;
    double t = 0, tt = 0;
    std::array<double, 2> w{}, tw{}, low{}, high{};
    std::array<Mean, reading_count> mean;
    Mean battery_power, motor_power;
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
  double forward = 0, sideways = 0;         // moved, by the map, along and across the mean heading
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
