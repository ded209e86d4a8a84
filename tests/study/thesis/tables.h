#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "robot/robot_model.h"

namespace joulecast::client::thesis {

// One number printed in the thesis, with the model's value for the same situation.
struct Row {
  std::string what;
  double printed_j = 0;
  std::optional<double> ours_j;  // empty where the thesis omits an input of the computation
  std::string remark;            // the explanation of the difference

  // Ours over printed, less 1.
  std::optional<double> difference() const {
    return ours_j ? std::optional(*ours_j / printed_j - 1) : std::nullopt;
  }
};

struct Table {
  std::string id;  // "2-3"
  std::string title;
  std::string assumptions;  // made for all rows
  std::vector<Row> rows;
};

// The thesis's two robots as shipped in deploy/robots.
struct Robots {
  robot::RobotModel nomad;
  robot::RobotModel p3dx;
};
Result<Robots> shipped_robots();

Table table_2_3(const robot::RobotModel& p3dx);   // straight lines, three speeds
Table table_2_4(const robot::RobotModel& p3dx);   // straight lines, three payloads
Table table_2_5(const robot::RobotModel& p3dx);   // Gaussian detours (2-48)
Table table_3_3(const robot::RobotModel& nomad);  // tables 3-3 and 3-4: the model's columns
Table table_3_5();                                // tables 3-5 to 3-9: why they cannot be computed
Table table_3_6();                                // tables 3-6 and 3-7
Table table_3_8();                                // tables 3-8 and 3-9
Table table_4_1(const robot::RobotModel& nomad);  // optimum and trapezoid
Table table_4_2(const robot::RobotModel& nomad);  // optimum and triangle
Table table_4_3(const robot::RobotModel& nomad);  // the same to an end speed
Table table_4_4(const robot::RobotModel& nomad);  // optimum in the triangle's time and in its own
Table table_5_4(const robot::RobotModel& nomad);  // exploration missions
// Table 5-4's savings under other assumptions than the thesis's equations, each labelled.
Table table_5_4_readings(const robot::RobotModel& nomad);

// All of the above in this order.
std::vector<Table> all_tables(const Robots& robots);

// One curve of figure 4-2: an optimal speed profile, sampled evenly in time.
struct Curve {
  std::string label;
  std::vector<double> time_s;
  std::vector<double> speed_m_s;
};

// Figure "4-2a" to "4-2d". The thesis prints neither payload, distance nor end speeds of every panel; the
// labels state the assumptions.
Result<std::vector<Curve>> figure(const robot::RobotModel& nomad, std::string_view id);

}  // namespace joulecast::client::thesis
