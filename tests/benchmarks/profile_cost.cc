// Cost of one straight-line profile without HTTP, in parts: CPU time of one thread, for one robot without and
// one with binding limits.
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string>

#include "answers/profile.h"
#include "planning/planner.h"
#include "tests/benchmarks/noisy_drive.h"

namespace joulecast::benchmarks {
namespace {

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

template <class F>
void time_of(const char* what, F&& once) {
  once();
  int count = 0;
  const double began = cpu_s();
  while (cpu_s() - began < 0.5)
    for (int k = 0; k < 50; ++k, ++count) once();
  std::printf("%-34s %8.2f us\n", what, (cpu_s() - began) / count * 1e6);
}

void run(const char* title, const robot::RobotModel& robot) {
  std::printf("%s\n", title);
  const auto model = *answers::model_in_force(robot, 1);
  const std::string text = R"({"path":[{"kind":"straight","length_m":10}],"payload_kg":5})";
  const nlohmann::json body = nlohmann::json::parse(text);
  nlohmann::json lean = body;
  lean["columns"] = false;
  const auto planner = planning::Planner::make(robot);
  planning::PathOptions options;
  options.payload_kg = 5;
  const auto path = planning::make_path(std::vector<planning::Segment>{planning::Straight{10}}, options);
  planning::Problem problem;
  problem.limits = planning::limits_of(robot);
  time_of("  reading the request's JSON", [&] {
    if (nlohmann::json::parse(text).empty()) std::abort();
  });
  time_of("  solving", [&] {
    if (!planner->cost(*path, problem)) std::abort();
  });
  time_of("  solving, profile and ledger", [&] {
    if (!planner->plan(*path, problem)) std::abort();
  });
  time_of("  the answer without columns", [&] {
    if (!answers::profile_answer(lean, *model)) std::abort();
  });
  time_of("  the whole answer", [&] {
    if (!answers::profile_answer(body, *model)) std::abort();
  });
}

}  // namespace
}  // namespace joulecast::benchmarks

int main() {
  using namespace joulecast::benchmarks;
  joulecast::robot::RobotModel free = robot_named("free");
  free.limits.speed_m_s = free.limits.acceleration_m_s2 = 10;
  free.limits.current_a = 200;
  free.battery.nominal_voltage_v = 200;
  run("limits that do not bind", free);
  run("limits that bind", robot_named("bound"));
}
