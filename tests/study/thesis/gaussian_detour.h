#pragma once

#include "robot/robot_model.h"

namespace joulecast::client::thesis {

// y = a exp(-x^2/(2 h^2)) with a = h = radius, over a chord centred on the peak, thesis (2-48). With
// u = x^2/a^2 the curve is outside the circle because exp(-u) >= 1 - u; a smaller h would cut it at the peak,
// where the curvature is a/h^2.
class GaussianDetour {
 public:
  // The chord is found so that the path is `length_m` long.
  GaussianDetour(double radius_m, double length_m);

  double chord_m() const { return chord_; }
  double length_m() const { return length_over(chord_); }

  // First to third derivative of y by x at x from the peak.
  struct Slopes {
    double first, second, third;
  };
  Slopes slopes(double x_m) const;

 private:
  double length_over(double chord_m) const;

  double radius_;
  double chord_;
};

struct DetourEnergy {
  double motor_j = 0;                // without load torque
  double combined_j = 0;             // with it
  double doubled_track_motor_j = 0;  // wheel speeds by (2-49) as printed, with 2 l where l belongs
  double doubled_track_combined_j = 0;
  double peak_wheel_acceleration_rad_s2 = 0;
};

// Energy of driving the detour while x moves along the chord in a trapezoid. Motors only.
DetourEnergy detour_energy(const robot::RobotModel& robot, const GaussianDetour& detour, double duration_s,
                           double ramp_share, double payload_kg);

}  // namespace joulecast::client::thesis
