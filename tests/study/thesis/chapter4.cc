#include <fmt/format.h>

#include <cmath>

#include "planning/line.h"
#include "tests/study/ramp/ramp.h"
#include "tests/study/thesis/tables.h"
#include "tests/support/straight_power.h"

namespace joulecast::client::thesis {
namespace {

planning::LineTask line(const robot::RobotModel& robot, double distance_m, double payload_kg,
                        double start_m_s = 0, double end_m_s = 0) {
  planning::LineTask task;
  task.power = dynamics::straight_power(robot, payload_kg).over_distance();
  task.distance = distance_m;
  task.start_speed = start_m_s;
  task.end_speed = end_m_s;
  return task;
}

double optimal_j(const planning::LineTask& task) {
  return planning::line_in_free_time(task)->energy_j();
}

// The distance with an optimum that costs `energy_j`; the optimum grows with distance.
double distance_for(planning::LineTask task, double energy_j) {
  double low = 0.1, high = 100;
  for (int k = 0; k < 60; ++k) {
    task.distance = 0.5 * (low + high);
    (optimal_j(task) < energy_j ? low : high) = task.distance;
  }
  return task.distance;
}

// Our optimum compared with a printed one; if they differ by more than rounding, the distance that would fit.
Row optimum(const std::string& what, double printed_j, const planning::LineTask& task,
            const std::string& remark = {}) {
  const double ours = optimal_j(task);
  Row row{what + ", optimal", printed_j, ours, remark};
  if (remark.empty())
    row.remark =
        std::fabs(ours / printed_j - 1) <= 0.015
            ? "(4-1)'s coefficients as printed, which are rounded, bring it 0.1 to 0.4 % nearer; the rest is "
              "not explained"
            : fmt::format("fits {:.2f} m", distance_for(task, printed_j));
  return row;
}

constexpr const char* measured_remark =
    "measured on the robot: its friction grows with load and speed, the model's does not";

}  // namespace

Table table_4_1(const robot::RobotModel& nomad) {
  Table table{"4-1",
              "Nomad, optimum against a trapezoid of three times 5 s",
              "from rest to rest in free time; ours is the closed form (4-9) with transversality (4-13)",
              {}};
  struct Printed {
    double distance_m, payload_kg, measured_j, optimal_j;
  };
  for (const Printed& p :
       {Printed{1.92, 0, 28.19, 16.03}, Printed{1.92, 5.7, 27.63, 16.28}, Printed{1.92, 10.5, 33.96, 16.44},
        Printed{5, 0, 49.89, 40.08}, Printed{5, 5.7, 56.1, 40.33}, Printed{5, 10.5, 63.32, 40.53},
        Printed{8.1, 0, 64.3, 52.06}, Printed{8.1, 5.7, 85.94, 64.31}, Printed{8.1, 10.5, 93.95, 64.53}}) {
    const auto task = line(nomad, p.distance_m, p.payload_kg);
    const std::string what = fmt::format("{:g} m, {:g} kg", p.distance_m, p.payload_kg);
    const bool odd = p.distance_m == 8.1 && p.payload_kg == 0;
    table.rows.push_back(optimum(what, p.optimal_j, task,
                                 odd ? fmt::format("breaks the monotone pattern of the table; fits {:.2f} m",
                                                   distance_for(task, p.optimal_j))
                                     : ""));
    table.rows.push_back({what + ", trapezoid", p.measured_j,
                          planning::ramp_in_time(task, 15, 1.0 / 3)->energy_j(), measured_remark});
  }
  return table;
}

Table table_4_2(const robot::RobotModel& nomad) {
  Table table{
      "4-2", "Nomad, optimum against a triangle, no payload", "from rest to rest; triangle time 2 D / v", {}};
  struct Printed {
    double distance_m, peak_m_s, measured_j, optimal_j;
  };
  for (const Printed& p :
       {Printed{1.57, 0.6, 17.55, 13.34}, Printed{4.2, 0.8, 50.61, 35.58}, Printed{7.5, 1.0, 83.44, 59.79}}) {
    const auto task = line(nomad, p.distance_m, 0);
    const std::string what = fmt::format("{:g} m, {:g} m/s", p.distance_m, p.peak_m_s);
    table.rows.push_back(optimum(what, p.optimal_j, task));
    table.rows.push_back({what + ", triangle", p.measured_j,
                          planning::ramp_in_time(task, 2 * p.distance_m / p.peak_m_s, 0.5)->energy_j(),
                          measured_remark});
  }
  return table;
}

// Section 4.3.1's triangles: 4 s up to the peak, 4 s down to the end speed.
constexpr double phase_s = 4;
constexpr double end_speed_m_s = 0.2;

double triangle_distance_m(double peak_m_s, double start_m_s, double end_m_s) {
  return 0.5 * phase_s * (2 * peak_m_s + start_m_s + end_m_s);
}

Table table_4_3(const robot::RobotModel& nomad) {
  Table table{
      "4-3",
      "Nomad, triangle with two accelerations and optimum, to an end speed of 0.2 m/s, 5.7 kg",
      "the thesis prints neither distances nor how two accelerations share the time; ours is over the "
      "distance of one triangle of section 4.3.1, 4 s up to the peak and 4 s down to the end speed",
      {}};
  struct Printed {
    double peak_m_s, measured_j, optimal_j;
  };
  for (const Printed& p :
       {Printed{0.6, 42.17, 27.12}, Printed{0.8, 62.07, 38.03}, Printed{1.0, 80.89, 48.85}}) {
    auto task = line(nomad, triangle_distance_m(p.peak_m_s, 0, end_speed_m_s), 5.7, 0, end_speed_m_s);
    const double fits = distance_for(task, p.optimal_j);
    const std::string what = fmt::format("{:g} m/s", p.peak_m_s);
    table.rows.push_back(
        {what + ", optimal", p.optimal_j, optimal_j(task),
         fmt::format(
             "over {:.2f} m; the printed value is the optimum over {:.2f} m. Such distances for the three "
             "rows are evenly spaced, as the speeds are: the second acceleration covers the rest",
             task.distance, fits)});
    const planning::RampProfile triangle(task.power,
                                         {{{phase_s, 0, p.peak_m_s / phase_s},
                                           {0, p.peak_m_s, 0},
                                           {phase_s, p.peak_m_s, (end_speed_m_s - p.peak_m_s) / phase_s}}});
    table.rows.push_back(
        {what + ", triangle", p.measured_j, triangle.energy_j(),
         "measured, over a longer way; and the robot's friction grows with load, the model's not"});
  }
  return table;
}

Table table_4_4(const robot::RobotModel& nomad) {
  Table table{
      "4-4",
      "Nomad, triangle with three accelerations, optimum in the triangle's time and in its own, 10.5 kg",
      "the thesis prints neither distances, end speeds nor times; ours is over the distance at which the "
      "optimum in its own time, from rest to rest, costs the printed value, and the triangle over it lasts "
      "2 D / v",
      {}};
  struct Printed {
    double peak_m_s, measured_j, in_triangle_time_j, in_free_time_j;
  };
  for (const Printed& p : {Printed{0.6, 68.26, 41.81, 36.18}, Printed{0.8, 97.36, 65.19, 51.53},
                           Printed{1.0, 135.53, 96.78, 71.7}}) {
    auto task = line(nomad, 1, 10.5);
    task.distance = distance_for(task, p.in_free_time_j);
    const double triangle_s = 2 * task.distance / p.peak_m_s;
    const double free_s = planning::line_in_free_time(task)->duration_s();
    double fast = 0.1, slow = free_s;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (fast + slow);
      (planning::LineProfile(task, middle).energy_j() > p.in_triangle_time_j ? fast : slow) = middle;
    }
    const auto phases = line(nomad, triangle_distance_m(p.peak_m_s, 0, 0), 10.5);
    const std::string what = fmt::format("{:g} m/s", p.peak_m_s);
    table.rows.push_back(
        {what + ", optimal in its own time", p.in_free_time_j, optimal_j(phases),
         fmt::format(
             "over {:.2f} m, one triangle of 4.3.1; the printed value is the optimum over {:.2f} m, on which "
             "the next row stands",
             phases.distance, task.distance)});
    table.rows.push_back(
        {what + ", optimal in the triangle's time", p.in_triangle_time_j,
         planning::LineProfile(task, triangle_s).energy_j(),
         fmt::format("over {:.2f} m in {:.1f} s; the printed value needs {:.1f} s, a mean of {:.2f} m/s, "
                     "above the triangle's peak: the two printed columns are not of one distance",
                     task.distance, triangle_s, fast, task.distance / fast)});
    table.rows.push_back({what + ", triangle", p.measured_j,
                          planning::ramp_in_time(task, triangle_s, 0.5)->energy_j(), measured_remark});
  }
  return table;
}

Result<std::vector<Curve>> figure(const robot::RobotModel& nomad, std::string_view id) {
  std::vector<std::pair<std::string, planning::LineTask>> tasks;
  const auto add = [&](const std::string& label, double distance_m, double payload_kg, double start,
                       double end) {
    tasks.emplace_back(label, line(nomad, distance_m, payload_kg, start, end));
  };
  if (id == "4-2a") {
    for (const double d : {1.0, 4.0, 7.0, 10.0}) add(fmt::format("{:g} m, 0 kg", d), d, 0, 0, 0);
  } else if (id == "4-2b") {
    for (const double m : {0.0, 5.7, 10.5}) add(fmt::format("{:g} kg, 10 m", m), 10, m, 0, 0);
  } else if (id == "4-2c" || id == "4-2d") {
    // The caption states 2 and 4 m/s; wheel speeds of 2 and 4 rad/s are 0.2 and 0.4 m/s, which section 4.3
    // uses.
    const bool start = id == "4-2c";
    for (const double v : {0.0, 0.2, 0.4})
      add(fmt::format("{} {:g} m/s, 10 m, 0 kg", start ? "from" : "to", v), 10, 0, start ? v : 0,
          start ? 0 : v);
  } else {
    return invalid("figure", fmt::format("is \"{}\", must be 4-2a, 4-2b, 4-2c or 4-2d", id));
  }
  std::vector<Curve> curves;
  for (const auto& [label, task] : tasks) {
    const auto profile = planning::line_in_free_time(task);
    if (!profile) return tl::unexpected(profile.error());
    Curve curve{label, {}, {}};
    for (int k = 0; k <= 200; ++k) {
      curve.time_s.push_back(profile->duration_s() * k / 200);
      curve.speed_m_s.push_back(profile->speed(curve.time_s.back()));
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

}  // namespace joulecast::client::thesis
