#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "dynamics/drive_model.h"
#include "dynamics/straight.h"
#include "planning/path.h"
#include "planning/problem.h"

namespace joulecast::planning {

struct BrokenLimit {
  std::string_view
      limit;  // speed m/s, acceleration m/s^2, yaw_rate rad/s, wheel_speed rad/s, current A, voltage V
  double reached = 0;
  double allowed = 0;
};

// Faster, less than 6e-4 of the dry friction is missing.
inline constexpr double creep_rad_s = 30 * dynamics::friction_width_rad_s;

// Share by which the motors' limits may be exceeded between rows, where the acceleration is constant.
inline constexpr double over_between_rows = 5e-5;

// Whether both wheels turn so slowly that their dry friction, which the drive model smooths through
// standstill, is missing: the computed motor loads are then too low.
bool creeps(const std::array<double, 2>& wheel_speed_rad_s);

// The peak values of a motion, for every quantity that a limit bounds.
struct Peaks {
  double peak_speed_m_s = 0;
  double peak_acceleration_m_s2 = 0;  // along the way; turning in place, of the wheels' rims
  double peak_yaw_rate_rad_s = 0;
  double peak_wheel_speed_rad_s = 0;
  double peak_current_a = 0, peak_voltage_v = 0;  // of the armatures

  void reach(const Peaks& other);
  // Includes wheels and armatures at an instant; armatures only unless the wheels creep.
  void reach(const std::array<double, 2>& wheel_speed_rad_s, const dynamics::PowerFlow<double>& flow);
  // The limits broken by more than rounding, in the order above: by 1e-6 of them; acceleration, current and
  // voltage, which depend on the slope of rounded speeds, by 1.5e-3.
  std::vector<BrokenLimit> beyond(const Limits& limits) const;
};

// The torque required of one wheel's motor at a place of a run, as a function of the speed v along the run's
// coordinate and its acceleration q:
//   through the gear  tau = inertia q + t0 + t1 v + t2 v^2 + scrub tanh(v/scrub_speed)
//   inside the motor  f   = f0 + f1 v + f2 v^2 + stribeck exp(-|v/stribeck_speed|^stribeck_exponent)
//   torque            T   = tau + gear |tau| + f.
// Its wheel turns at pace * v. Next to where it reverses, it creeps at any v: dry friction and gear fade by
// v / sqrt(v^2 + creep^2) as in the drive model. Motors' limits hold for that and without fading.
struct WheelLoad {
  double pace = 0;  // rad per unit of the coordinate
  double inertia = 0;
  double t0 = 0, t1 = 0, t2 = 0;
  double f0 = 0, f1 = 0, f2 = 0;
  double stribeck = 0, stribeck_speed = 1, stribeck_exponent = 2;
  double scrub = 0, scrub_speed = 1;
  double gear = 0;  // signed by the wheel's direction, as dry friction is
  double creep = 0, t_dry = 0, f_dry = 0;

  bool operator==(const WheelLoad&) const = default;

  bool quadratic() const { return stribeck == 0 && scrub == 0 && gear == 0 && creep == 0; }
  bool linear() const { return quadratic() && t1 == 0 && t2 == 0 && f2 == 0; }
  // As it is once it does not creep.
  WheelLoad rolling() const {
    WheelLoad w = *this;
    w.t0 += std::exchange(w.t_dry, 0), w.f0 += std::exchange(w.f_dry, 0), w.creep = 0;
    return w;
  }
  double direction(double v) const { return creep == 0 ? 1 : v / std::hypot(v, creep); }
  // Parts between two speeds over which scrub changes so little that Gauss's rule of two points, which is
  // 1e-3 off over a scrub_speed where the change is greatest, integrates it.
  int parts(double from, double to) const {
    constexpr double most = 32;
    if (scrub == 0 || std::min(from, to) > 4 * scrub_speed) return 1;
    return static_cast<int>(std::clamp(std::ceil(std::fabs(to - from) / scrub_speed), 1.0, most));
  }
};
using WheelLoads = std::array<WheelLoad, 2>;

// Parts in which a cell is integrated where a motor turns into a generator, or back, for the rate of losses
// changes there. The error falls with their square, from 2e-3 of a braking motion's energy, and is the
// smaller the less power the motor takes or gives at one end.
inline int parts_of_turn(double from_w, double to_w, double idle_w) {
  if ((from_w > 0) == (to_w > 0)) return 1;
  const double from = std::fabs(from_w), to = std::fabs(to_w);
  return std::max(1,
                  static_cast<int>(std::ceil(32 * std::sqrt(2 * std::min(from, to) / (idle_w + from + to)))));
}

// Electrical constants of the drive. P = copper T^2 + back_emf w T + brush |T| for each motor; the battery
// gives idle + sum of (up P where P > 0, down P where P < 0).
struct Electric {
  std::array<double, 2> copper_w_n2_m2{};
  double back_emf = 0;  // K_w/K_t
  double brush_w_nm = 0;
  double idle_w = 0;
  double up = 1, down = 1;
  double torque_constant_nm_a = 0;
  double voltage_constant_v_s_rad = 0;
  std::array<double, 2> volts_per_nm{};  // of the armature: R/K_t

  bool symmetric() const {  // equal motors
    return copper_w_n2_m2[0] == copper_w_n2_m2[1] && volts_per_nm[0] == volts_per_nm[1];
  }
};

// The drive model of a robot as the planner needs it.
class DriveLoads {
 public:
  // `regeneration` replaces the returned fraction that the robot's effects give.
  static Result<DriveLoads> make(const robot::RobotModel& robot, std::optional<double> regeneration);

  const dynamics::DriveModel& model() const { return model_; }
  const Electric& electric() const { return electric_; }

  WheelLoads at(const Run& run, const Place& place) const;

  // Whether the moment of scrub builds up with the yaw rate.
  bool scrubs() const { return scrub_rate_rad_s_ > 0; }

  bool needs_position() const { return needs_position_; }

  // Whether the loads are the same all along the run.
  bool uniform(const Run& run) const;
  // Those of a uniform run.
  std::optional<WheelLoads> uniform_loads(const Run& run) const {
    return uniform(run) ? std::optional(at(run, run.at(0.5 * run.length()))) : std::nullopt;
  }

  dynamics::Instant instant(const Run& run, const Place& place, double speed, double acceleration) const;

 private:
  explicit DriveLoads(dynamics::DriveModel model) : model_(std::move(model)) {}

  dynamics::DriveModel model_;
  Electric electric_;
  bool needs_position_ = false, needs_heading_ = false;
  std::array<double, 2> stribeck_nm_{};
  double stribeck_speed_rad_s_ = 1, stribeck_exponent_ = 2;
  double scrub_rate_rad_s_ = 0;  // 0: no scrub
};

// P of each motor where its load is linear: thesis (4-1) on any coordinate.
dynamics::QuadraticPower motor_power(const Electric& electric, std::size_t side, const WheelLoad& load);

}  // namespace joulecast::planning
