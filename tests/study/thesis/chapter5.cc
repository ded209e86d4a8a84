#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <span>
#include <variant>
#include <vector>

#include "client/virtual_robot/fleet.h"
#include "robot/robot_file.h"
#include "tests/study/exploration/explore.h"
#include "tests/study/exploration/mission_energy.h"
#include "tests/study/ramp/ramp.h"
#include "tests/study/thesis/tables.h"
#include "tests/support/straight_power.h"

namespace joulecast::client::thesis {
namespace {

struct PrintedCase {
  int number;
  double payload_kg, triangle_j, optimal_j;
};
constexpr PrintedCase printed_cases[] = {
    {1, 0, 505.88, 165.44}, {1, 5.7, 505.75, 166.98}, {1, 10.5, 505.65, 168.61},
    {2, 0, 378.65, 112.87}, {2, 5.7, 378.51, 113.73}, {2, 10.5, 378.48, 114.67},
    {3, 0, 360.94, 114.87}, {3, 5.7, 360.46, 115.93}, {3, 10.5, 360.08, 117.69},
    {4, 0, 543.98, 159.18}, {4, 5.7, 543.83, 160.57}, {4, 10.5, 543.69, 162.15},
    {5, 0, 290.99, 103.81}, {5, 5.7, 290.9, 105.59},  {5, 10.5, 290.82, 105.46}};

exploration::MissionEnergy mission(const robot::RobotModel& nomad, const exploration::Exploration& explored,
                                   double payload_kg) {
  exploration::MissionOptions options;
  options.payload_kg = payload_kg;
  return *exploration::mission_energy(nomad, explored.motions, options);
}

// The leg on which the optimum saves this share against a triangle of 1 m/s; shorter legs save more.
double leg_that_saves(const robot::RobotModel& nomad, double saving) {
  double low = 0.05, high = 20;
  for (int k = 0; k < 50; ++k) {
    const double middle = 0.5 * (low + high);
    const exploration::Motion leg = exploration::Straight{{0, 0}, {middle, 0}};
    const auto energy = *exploration::mission_energy(nomad, std::span(&leg, 1), {});
    (energy.saving() > saving ? low : high) = middle;
  }
  return low;
}

// Energy of the motors over the straights' triangles without regenerative braking.
double triangles_without_regeneration_j(const robot::RobotModel& nomad,
                                        const exploration::Exploration& explored) {
  planning::LineTask task;
  task.power = dynamics::straight_power(nomad, 0).over_distance();
  double sum = 0;
  for (const exploration::Motion& motion : explored.motions) {
    const auto* straight = std::get_if<exploration::Straight>(&motion);
    if (straight == nullptr) continue;
    task.distance = straight->length_m();
    const auto triangle = *planning::ramp_in_time(task, 2 * task.distance, 0.5);
    constexpr int steps = 4000;
    for (int k = 0; k < steps; ++k) {
      const double h = triangle.duration_s() / steps;
      sum += h * std::max(0.0, triangle.at((k + 0.5) * h).power_w);
    }
  }
  return sum;
}

// The mission with every straight's length multiplied.
exploration::MissionEnergy stretched(const robot::RobotModel& nomad, const exploration::Exploration& explored,
                                     double factor) {
  std::vector<exploration::Motion> motions = explored.motions;
  for (exploration::Motion& motion : motions) {
    if (auto* straight = std::get_if<exploration::Straight>(&motion))
      straight->to = {straight->from.x_m + factor * (straight->to.x_m - straight->from.x_m),
                      straight->from.y_m + factor * (straight->to.y_m - straight->from.y_m)};
  }
  return *exploration::mission_energy(nomad, motions, {});
}

}  // namespace

Table table_5_4_readings(const robot::RobotModel& nomad) {
  const double radius = nomad.kinematics.wheel_radius_m, half_track = nomad.kinematics.half_track_m;
  const double friction_j_m = dynamics::straight_power(nomad, 0).over_distance().c3;
  const auto* longest =
      std::max_element(std::begin(printed_cases), std::end(printed_cases),
                       [](const PrintedCase& a, const PrintedCase& b) { return a.optimal_j < b.optimal_j; });
  Table table{
      "5-4 readings",
      "what could make the printed savings of 60 to 70 %, no payload",
      fmt::format(
          "none of the thesis's equations does. Its triangles fit paths of the length of ours or "
          "longer, its optima paths of less than {:.0f} m in every case, since friction alone takes "
          "{:.2f} J/m of either; that the optimum is printed as both slower and sooner finished "
          "(5.5) indicates the same. Rows from the third on are slips tried, not readings of an equation, "
          "and no value elsewhere uses them",
          longest->optimal_j / friction_j_m, friction_j_m),
      {}};
  int present = 0;
  for (const PrintedCase& p : printed_cases) {
    if (p.number == present) continue;
    present = p.number;
    const exploration::Exploration explored = *exploration::explore(*exploration::thesis_case(p.number));
    const auto ours = mission(nomad, explored, 0);
    const double printed_saving = 1 - p.optimal_j / p.triangle_j;
    const auto row = [&](const std::string& reading, double optimal, double triangle,
                         const std::string& why) {
      table.rows.push_back({fmt::format("case {}, {}", p.number, reading), p.optimal_j, optimal,
                            fmt::format("saving {:.1f} %, printed {:.1f} %: {}",
                                        100 * (1 - optimal / triangle), 100 * printed_saving, why)});
    };
    row("as (4-1), (4-9), (4-13)", ours.optimal_total_j(), ours.triangle_total_j(), "the equations");
    row("braking returns nothing", ours.optimal_total_j(),
        ours.turns.energy_j + triangles_without_regeneration_j(nomad, explored),
        "the triangle barely regenerates, since friction brakes it");
    const auto slip = [&](double wrong_m) {
      return ours.turns.energy_j + stretched(nomad, explored, radius / wrong_m).optimal.energy_j;
    };
    row("optimum's wheel angle D/l", slip(half_track), ours.triangle_total_j(),
        "5.1 calls 0.165 m the robot's radius");
    row("optimum's wheel angle D/(2 l)", slip(2 * half_track), ours.triangle_total_j(),
        "the track for the wheel's radius: of the size printed, and the optimum ends sooner and slower as "
        "printed");
  }
  return table;
}

Table table_5_4(const robot::RobotModel& nomad) {
  const double friction_j_m = dynamics::straight_power(nomad, 0).over_distance().c3;
  Table table{
      "5-4",
      "Nomad, exploration of five cases: triangle of 1 m/s against the optimum",
      fmt::format(
          "nodes every 0.2 m (15 nodes are then less than 0.2 %, see section 5.4); turns in place at the "
          "robot's yaw rate limit, which the thesis does not print. The printed triangles cannot come from "
          "(4-1): "
          "its friction costs any profile {:.2f} J/m, so that a triangle of 1 m/s and the optimum differ by "
          "60 % "
          "only on legs below {:.2f} m, and its energy grows with payload while the printed one falls. Of "
          "the "
          "order of the cases, only that 4 and 1 are the dearest compares: the cheapest is printed as 5, "
          "and is 2 here",
          friction_j_m, leg_that_saves(nomad, 0.6)),
      {}};
  exploration::Exploration fine, coarse;
  int present = 0;
  for (const PrintedCase& p : printed_cases) {
    if (p.number != present) {
      exploration::Map map = *exploration::thesis_case(p.number);
      fine = *exploration::explore(map);
      map.node_spacing_m = 1;
      coarse = *exploration::explore(map);
      present = p.number;
    }
    const auto ours = mission(nomad, fine, p.payload_kg), sparse = mission(nomad, coarse, p.payload_kg);
    const std::string what = fmt::format("case {}, {:g} kg", p.number, p.payload_kg);
    table.rows.push_back({what + ", triangle", p.triangle_j, ours.triangle_total_j(),
                          fmt::format("saving: printed {:.0f} %, ours {:.1f} %",
                                      100 * (1 - p.optimal_j / p.triangle_j), 100 * ours.saving())});
    table.rows.push_back(
        {what + ", optimal", p.optimal_j, ours.optimal_total_j(),
         fmt::format(
             "{:.1f} m, {} looks, {} corners rounded; friction allows the printed value {:.1f} m. Nodes "
             "every 1 m, as the counts in tables 5-2 and 5-3 suggest, leave more unseen: {:.1f} J, {:.1f} m",
             fine.length_m(), fine.rounds.size(), fine.detours(), p.optimal_j / friction_j_m,
             sparse.optimal_total_j(), coarse.length_m())});
  }
  return table;
}

Result<Robots> shipped_robots() {
  const auto find = [](std::string_view kind) {
    const auto shipped = virtual_robot::shipped_robots();
    const auto found =
        std::find_if(shipped.begin(), shipped.end(), [&](const auto& r) { return r.kind == kind; });
    return robot::parse_robot(found->json_text);
  };
  auto nomad = find("nomad"), p3dx = find("p3dx");
  if (!nomad) return tl::unexpected(nomad.error());
  if (!p3dx) return tl::unexpected(p3dx.error());
  return Robots{std::move(*nomad), std::move(*p3dx)};
}

std::vector<Table> all_tables(const Robots& robots) {
  return {table_2_3(robots.p3dx),
          table_2_4(robots.p3dx),
          table_2_5(robots.p3dx),
          table_3_3(robots.nomad),
          table_3_5(),
          table_3_6(),
          table_3_8(),
          table_4_1(robots.nomad),
          table_4_2(robots.nomad),
          table_4_3(robots.nomad),
          table_4_4(robots.nomad),
          table_5_4(robots.nomad),
          table_5_4_readings(robots.nomad)};
}

}  // namespace joulecast::client::thesis
