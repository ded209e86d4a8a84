// Prints the least energy of a robot along a path: price_a_path ROBOT_FILE
#include <cstdio>
#include <vector>

#include "planning/planner.h"
#include "robot/robot_file.h"

int main(int argc, char** argv) {
  using namespace joulecast::planning;
  const auto robot = joulecast::robot::load_robot(argc > 1 ? argv[1] : "robot.json");
  if (!robot) return std::fprintf(stderr, "%s\n", describe(robot.error()).c_str()), 1;
  const auto path = make_path(std::vector<Segment>{Straight{10}, TurnInPlace{1.57}, Straight{5}});
  const auto answer = plan(*robot, *path, {.limits = limits_of(*robot)});
  if (!answer) return std::fprintf(stderr, "%s\n", describe(answer.error()).c_str()), 1;
  std::printf("%.0f J in %.1f s\n", answer->summary.energy_j, answer->summary.duration_s);
}
