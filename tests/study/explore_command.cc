
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "client/commands/option.h"
#include "client/files.h"
#include "client/progress.h"
#include "client/virtual_robot/fleet.h"
#include "robot/robot_file.h"
#include "tests/study/exploration/exploration_drawing.h"
#include "tests/study/exploration/exploration_json.h"
#include "tests/study/exploration/map_file.h"
#include "tests/study/study_commands.h"

namespace joulecast::client {
namespace {

using namespace exploration;

struct ExploreOptions {
  int number = 0;
  std::string map_file;
  std::string robot_file;
  std::vector<double> payloads_kg;
  std::optional<double> node_spacing_m;
  std::optional<double> turn_rate_rad_s;
  std::string svg_file;
  bool json = false;
  bool force = false;
};

Result<Map> chosen_map(const ExploreOptions& options) {
  auto map = options.map_file.empty() ? thesis_case(options.number) : load_map(options.map_file);
  if (map && options.node_spacing_m) {
    map->node_spacing_m = *options.node_spacing_m;
    if (auto ok = validate(*map); !ok) return tl::unexpected(ok.error());
  }
  return map;
}

Result<robot::RobotModel> chosen_robot(const ExploreOptions& options) {
  if (!options.robot_file.empty()) return robot::load_robot(options.robot_file);
  const auto shipped = virtual_robot::shipped_robots();
  const auto nomad =
      std::find_if(shipped.begin(), shipped.end(), [](const auto& r) { return r.kind == "nomad"; });
  return robot::parse_robot(nomad->json_text);
}

// The thesis accounts for the motors of its robot; the owner of another robot pays its idle power too.
bool of_battery(const ExploreOptions& options) {
  return !options.robot_file.empty();
}

// The thesis's three payloads as far as the robot carries them.
std::vector<double> chosen_payloads(const ExploreOptions& options, const robot::RobotModel& robot) {
  if (!options.payloads_kg.empty()) return options.payloads_kg;
  std::vector<double> payloads{0, 5.7, 10.5};
  std::erase_if(payloads, [&](double kg) { return kg > robot.limits.payload_kg; });
  return payloads;
}

void print_exploration(const std::string& title, const char* of, const Exploration& e,
                       const std::vector<MissionEnergy>& energy) {
  std::printf("%s: %s, %zu of %zu nodes unseen after %zu looks, %.1f m and %.1f rad of turns\n",
              title.c_str(), e.outcome == Outcome::explored ? "explored" : "stuck", e.unseen, e.nodes.size(),
              e.rounds.size(), e.length_m(), e.turned_rad());
  for (std::size_t k = 0; k < e.rounds.size(); ++k) {
    const Scan& scan = e.rounds[k].scan;
    std::printf("  %zu  look from (%.2f, %.2f): %zu unseen\n", k + 1, scan.at.x_m, scan.at.y_m,
                scan.unseen_after);
    if (!e.rounds[k].next) continue;
    const NextBestView& view = *e.rounds[k].next;
    const auto kept = std::count_if(
        view.candidates.begin(), view.candidates.end(),
        [](const exploration::Candidate& c) { return c.fate == exploration::Candidate::Fate::kept; });
    std::printf("     best of %td candidates shows %zu; way:", static_cast<std::ptrdiff_t>(kept),
                view.candidates[view.winner].unseen_visible);
    for (const Point& p : view.path) std::printf(" (%.2f, %.2f)", p.x_m, p.y_m);
    std::printf("\n");
  }
  std::printf("\n  %-19s  turns   triangle    optimal   saving   triangle time   optimal time\n", of);
  for (const MissionEnergy& m : energy) {
    std::printf("  %8g kg       %8.2f %10.2f %10.2f %7.1f %% %13.1f s %12.1f s\n", m.payload_kg,
                m.turns.energy_j, m.triangle_total_j(), m.optimal_total_j(), 100 * m.saving(),
                m.turns.duration_s + m.triangle.duration_s, m.turns.duration_s + m.optimal.duration_s);
  }
}

Exit run_explore(const ExploreOptions& options) {
  const auto map = chosen_map(options);
  if (!map) return report(map.error());
  const auto robot = chosen_robot(options);
  if (!robot) return report(robot.error());
  const auto exploration = [&] {
    Progress progress("exploring", "nodes");
    return explore(*map, [&progress](std::size_t seen, std::size_t nodes) {
      progress.set_total(nodes);
      progress.reach(seen);
    });
  }();
  if (!exploration) return report(exploration.error());
  std::vector<MissionEnergy> energy;
  for (const double payload_kg : chosen_payloads(options, *robot)) {
    MissionOptions mission;
    mission.payload_kg = payload_kg;
    mission.turn_rate_rad_s = options.turn_rate_rad_s;
    mission.idle = of_battery(options);
    const auto spent = mission_energy(*robot, exploration->motions, mission);
    if (!spent) return report(spent.error());
    energy.push_back(*spent);
  }
  const std::string title =
      options.map_file.empty() ? "Case " + std::to_string(options.number) : options.map_file;
  if (!options.svg_file.empty()) {
    const std::string drawing =
        report::draw_exploration(title + " explored by " + robot->robot_id, *map, *exploration, energy);
    if (auto ok = write_text_file(options.svg_file, drawing, existing(options.force)); !ok)
      return report(ok.error());
  }
  if (options.json)
    std::printf("%s\n", to_json(*map, *exploration, energy).dump(2).c_str());
  else
    print_exploration(title, of_battery(options) ? "battery energy [J]" : "motors' energy [J]", *exploration,
                      energy);
  return exploration->outcome == Outcome::explored ? Exit::ok : Exit::infeasible;
}

}  // namespace

void add_explore(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<ExploreOptions>();
  auto* command = program.add_subcommand(
      "explore", "Explore a map by next best views and DistBug, and price the mission (thesis chapter 5)");
  auto* ground = command->add_option_group("ground");
  std::vector<std::string> cases;
  for (int k = 1; k <= thesis_case_count; ++k) cases.push_back(std::to_string(k));
  add_option(*ground, "--case", options->number, "case of the thesis, table 5-1", one_of(cases))
      ->default_str("");
  ground->add_option("--map", options->map_file, "map file (tests/study/exploration/map.schema.json)");
  ground->require_option(1);
  command->add_option(
      "--robot", options->robot_file,
      "robot file, whose idle power is counted; without one the motors of the thesis's Nomad");
  command->add_option("--payload", options->payloads_kg,
                      "payload [kg], may be repeated; 0, 5.7 and 10.5 when not given");
  command->add_option("--node-spacing", options->node_spacing_m,
                      "distance of the nodes [m], instead of the map's");
  command->add_option("--turn-rate", options->turn_rate_rad_s,
                      "rate of turns in place [rad/s]; the robot's limit when not given");
  command->add_option("--plot,--svg", options->svg_file, "draw the exploration into this file");
  command->add_flag("--json", options->json, "print the exploration log as JSON");
  command->add_flag("--force", options->force, force_help);
  command->callback([options, &exit] { exit = run_explore(*options); });
}

}  // namespace joulecast::client
