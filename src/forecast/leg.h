#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "planning/path.h"
#include "robot/robot_model.h"
#include "signals/sample.h"

namespace joulecast::forecast {

using planning::Motion;
using planning::motion_count;

// One segment of a past mission without change of its kind of motion: from stop to stop, or a halt.
struct Leg {
  Motion motion = Motion::stand;
  double duration_s = 0;
  double way = 0;    // driven [m] or turned in place [rad], >= 0
  double speed = 0;  // cruise [m/s, rad/s] of the trapezoid with this duration, way and integral of speed^2
  double curvature_1_m = 0;  // net heading change over the way, >= 0; 0 unless driving
  double payload_kg = 0;
  double battery_j = 0;  // measured at the terminals; NaN where a part of it was not measured
  // The trapezoid that the velocity commands planned: way, cruise and duration. 0: not commanded, or unknown.
  double planned_way = 0, planned_speed = 0, planned_s = 0;
};

struct PastMission {
  std::int64_t start_utime_us = 0;
  std::vector<Leg> legs;
};

// Slower than this, of body and wheel rims, a robot stands: 1 % of its speed limit.
double still_speed_m_s(const robot::RobotModel& robot);

// The tracker's input from one sample.
struct LegSample {
  double interval_s = 0;  // since the previous sample; 0: a gap lies between them
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double power_w = 0;  // measured at the battery, positive discharging; NaN: not measured
  double payload_kg = 0;
  std::array<double, 2> command{signals::unmeasured, signals::unmeasured};  // velocity: m/s, rad/s
};

// Cuts a mission into legs as its samples arrive. A change of motion counts once it has lasted `settle_s`;
// shorter ones stay with the leg they interrupt. A leg also ends where its speed falls below a tenth of the
// leg's greatest and then rises above a fifth of it: a stop without a halt.
class LegTracker {
 public:
  static constexpr double settle_s = 0.15;
  static constexpr std::size_t most_legs = 1000;  // of one mission; later legs are not recorded

  explicit LegTracker(const robot::RobotModel& robot)
      : half_track_m_(robot.kinematics.half_track_m), still_m_s_(still_speed_m_s(robot)) {}

  // Starts a new mission; legs not taken are discarded.
  void begin();
  void add(const LegSample& sample);
  // The legs so far, the last one closed.
  std::vector<Leg> take();

 private:
  struct Commanded {
    double way = 0, duration_s = 0, peak = 0;  // m or rad

    void join(const Commanded& other);
  };
  struct Piece {
    Motion motion = Motion::stand;
    double duration_s = 0, way_m = 0, way_rad = 0, heading_rad = 0, square_m2_s = 0, square_rad2_s = 0;
    double payload_kg = 0, battery_j = 0;
    std::array<Commanded, 2> commanded{};  // driving, turning

    void join(const Piece& other);
  };

  Motion motion_of(double speed_m_s, double yaw_rate_rad_s) const;
  void close(const Piece& piece);
  // Adds to the current leg, which ends at its slowest point when it accelerates again.
  void go_on(const Piece& piece, double speed);
  Piece end_current();

  double half_track_m_;
  double still_m_s_;
  std::optional<LegSample> last_;
  std::optional<Piece> current_, pending_;
  std::optional<Piece> slowed_;    // of the current leg, since its slowest after it slowed down
  double peak_ = 0, slowest_ = 0;  // speeds of the current leg, of the wheels' rims [m/s]
  std::vector<Leg> legs_;
};

}  // namespace joulecast::forecast
