#include <fmt/format.h>

#include "tests/study/ramp/ramp.h"
#include "tests/study/thesis/tables.h"
#include "tests/support/straight_power.h"

namespace joulecast::client::thesis {
namespace {

constexpr double acceleration_time_s = 4;  // section 3.2.1
constexpr double path_distance_m = 10;

struct Printed {
  double acceleration_m_s2;
  double payload_kg;
  double left_j, right_j;
};
constexpr Printed printed[] = {
    {0.125, 0, 60.48, 57.6},    {0.15, 0, 60.99, 58.47},    {0.175, 0, 63.57, 60.28},
    {0.2, 0, 64.9, 62.77},      {0.225, 0, 66.13, 64.18},   {0.255, 0, 65.14, 64.31},
    {0.125, 8.25, 65.11, 62.2}, {0.15, 8.25, 67.16, 64.59}, {0.175, 8.25, 70.02, 67.7},
    {0.2, 8.25, 72.97, 70.78},  {0.225, 8.25, 74.34, 72.4}, {0.255, 8.25, 78.06, 76.26}};

// Accelerating for 4 s, braking for 4 s, cruising in between.
planning::RampProfile run(const dynamics::QuadraticPower& power, double acceleration, double distance) {
  const double peak = acceleration * acceleration_time_s;
  const double cruise_s = distance / peak - acceleration_time_s;
  return planning::RampProfile(power, {{{acceleration_time_s, 0, acceleration},
                                        {cruise_s, peak, 0},
                                        {acceleration_time_s, peak, -acceleration}}});
}

}  // namespace

Table table_3_3(const robot::RobotModel& nomad) {
  Table table{"3-3, 3-4",
              "Nomad, 10 m with six accelerations: columns of the model",
              "4 s of acceleration (3.2.1), cruise, 4 s of braking; the thesis does not print how it brakes",
              {}};
  for (const Printed& p : printed) {
    const auto power = dynamics::straight_power(nomad, p.payload_kg);
    // (3-2), which the thesis numbers wheel 1, has the larger friction torque, 0.3728; so has the printed
    // left.
    for (const bool left : {true, false}) {
      const std::size_t side = left ? robot::right : robot::left;
      const auto along = rescaled(power.side[side], power.wheel_radius_m);
      const double ours = run(along, p.acceleration_m_s2, path_distance_m).energy_j();
      const double value = left ? p.left_j : p.right_j;
      const double cruise_j_m = along.power_w(4 * p.acceleration_m_s2, 0) / (4 * p.acceleration_m_s2);
      table.rows.push_back({fmt::format("{:g} m/s^2, {:g} kg, {} motor", p.acceleration_m_s2, p.payload_kg,
                                        left ? "left" : "right"),
                            value, ours,
                            fmt::format("(3-2)/(3-3) need {:.1f} m for the printed value, not 10 m",
                                        path_distance_m + (value - ours) / cruise_j_m)});
    }
  }
  return table;
}

// Tables 3-5 to 3-9 compare with measured energies without printing the motion: they can be compared with
// each other, not computed.
Table table_3_5() {
  return {
      "3-5",
      "Nomad, straight lines: error of predicted against measured energy",
      "cannot be computed: the errors are of measured energies, most of which are not printed. Those that "
      "are, in tables 3-3 and 3-4, give the column of 0 kg as the error of both motors' sum, but for "
      "0.175 m/s^2 (6.23 %, printed 5.99); table 3-4's rows, headed 8.25 kg, give the column of 5.7 kg "
      "(3.82, 3.69, 0.69, 0.75, 6.70, 6.52 %), "
      "so that one of the two headings is wrong. Nothing is printed behind 2.5, 8.25 and 10.5 kg",
      {}};
}

Table table_3_6() {
  Table table{
      "3-6, 3-7",
      "Nomad, Bezier curve to the right: columns of the model",
      "cannot be computed: of the control points one number each is printed (0, 2.7, 2.7, 2.7), not two; "
      "neither where the curve begins on the way nor the speed along it is, and (3-6) halves the term "
      "of turning",
      {}};
  struct Printed {
    double acceleration_m_s2, payload_kg, left_j, right_j;
  };
  for (const Printed& p :
       {Printed{0.15, 0, 26.65, 22.57}, Printed{0.18, 0, 23, 22.69}, Printed{0.2, 0, 25.6, 24.72},
        Printed{0.22, 0, 26.19, 24.68}, Printed{0.15, 8.25, 28.47, 27.51}, Printed{0.18, 8.25, 31.67, 30.89},
        Printed{0.2, 8.25, 32.3, 30.45}, Printed{0.22, 8.25, 31.39, 29.58}}) {
    for (const bool left : {true, false})
      table.rows.push_back({fmt::format("{:g} m/s^2, {:g} kg, {} motor", p.acceleration_m_s2, p.payload_kg,
                                        left ? "left" : "right"),
                            left ? p.left_j : p.right_j, std::nullopt,
                            "the curve and the motion along it are not printed"});
  }
  return table;
}

Table table_3_8() {
  return {
      "3-8, 3-9",
      "Nomad, Bezier curves: error of predicted against measured energy",
      "cannot be computed, as 3-6 and 3-7. Nor do these tables follow from those: their printed energies "
      "give errors of 10.0, 0.8, 14.3 and 12.9 % without payload, where 3-8 prints 1.10, 0.84, 10.79 and "
      "10.45 %; the rows headed 8.25 kg give 13.84, 6.59, 13.92 and 2.60 %, of which the first and the last "
      "are printed under 10.5 kg. Energies of 5.7 kg and of the left curve are not printed",
      {}};
}

}  // namespace joulecast::client::thesis
