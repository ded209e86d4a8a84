#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/table.h"
#include "gap/diagnosis.h"
#include "gap/diagnosis_json.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

struct Options {
  std::vector<std::string> logs;
  std::string robot_file;
  std::string robot_id;
  std::string apply;
  bool json = false;
};

void print(const gap::Diagnosis& d) {
  std::printf("%s: %zu missions, %zu samples%s\n", d.robot_id.c_str(), d.missions, d.samples,
              d.motor_channels ? "" : " (no motor channels: judged from battery power and motion alone)");
  std::printf("gap: energy %+.1f %%, absolute power %.1f %% (noise floor %.1f %%)\n", 100 * d.energy_relative,
              100 * d.power_absolute_relative, 100 * d.noise_floor);
  const auto verdict = gap::name_of(d.verdict);
  std::printf("verdict: %.*s (probability %.2f)\n", static_cast<int>(verdict.size()), verdict.data(),
              d.verdict_probability);
  for (const auto& e : d.effects) {
    std::printf("  %s: probability %.2f, closes %.0f %% of the gap\n", e.id.c_str(), e.probability,
                100 * e.share);
    for (const auto& p : e.parameters) {
      const std::string unit = p.unit == "1" ? "" : " " + p.unit;
      if (p.deviation >= 0) {
        std::printf("    %s = %.4g +- %.2g%s\n", p.name.c_str(), p.value, p.deviation, unit.c_str());
      } else {
        std::printf("    %s = %.4g%s\n", p.name.c_str(), p.value, unit.c_str());
      }
    }
    for (const auto& other : e.alternatives) std::printf("    cannot be told from %s\n", other.c_str());
  }
  if (!d.outside.channel.empty()) {
    std::printf("  outside the catalogue: in %s, follows %s (probability %.2f)\n", d.outside.channel.c_str(),
                d.outside.follows.c_str(), d.outside.probability);
  }
  if (d.shrinkage) {
    std::printf(
        "held-out gap: %.1f %% -> %.1f %%, shrinks by %.0f %% [%.0f, %.0f]; remaining is %.1f noise floors\n",
        100 * d.shrinkage->before, 100 * d.shrinkage->after, 100 * d.shrinkage->fraction,
        100 * d.shrinkage->interval[0], 100 * d.shrinkage->interval[1],
        d.shrinkage->remaining_over_noise_floor);
  }
  if (!d.where.empty()) std::printf("where:\n");
  for (std::size_t k = 0; k < d.where.size() && k < 8; ++k) {
    const auto& w = d.where[k];
    const std::string range =
        w.label.empty() ? std::to_string(w.from) + " to " + std::to_string(w.to) : w.label;
    std::printf("  %s, %s %s: %+.0f %% of the gap [%.0f, %.0f]\n", w.channel.c_str(), w.variable.c_str(),
                range.c_str(), 100 * w.share, 100 * w.interval[0], 100 * w.interval[1]);
  }
  for (const auto& n : d.next_drive) {
    std::printf("next drive, to tell %s: %s (log evidence +%.1f)\n", n.separates.c_str(), n.manoeuvre.c_str(),
                n.expected_log_evidence);
  }
}

// The robot file with the effects found, next to those it has.
Exit apply(const gap::Diagnosis& d, robot::RobotModel robot, const std::string& path) {
  for (const auto& effect : d.adoptable) {
    std::erase_if(robot.effects, [&](const robot::AdoptedEffect& e) { return e.id == effect.id; });
    robot.effects.push_back(effect);
  }
  std::ofstream out(path, std::ios::binary);
  out << robot::to_json_text(robot) << '\n';
  out.close();
  if (!out) return report({Fault::unavailable, path, "cannot be written"});
  return Exit::ok;
}

Exit run(const Options& options) {
  const auto robot = robot::load_robot(options.robot_file);
  if (!robot) return report(robot.error());
  const auto recordings = gap::load_recordings(options.logs, options.robot_id);
  if (!recordings) return report(recordings.error());
  const auto diagnosis = gap::diagnose(*recordings, *robot);
  if (!diagnosis) return report(diagnosis.error());
  if (options.json) {
    std::printf("%s\n", gap::to_json_text(*diagnosis).c_str());
  } else {
    print(*diagnosis);
  }
  return options.apply.empty() ? Exit::ok : apply(*diagnosis, *robot, options.apply);
}

}  // namespace

void add_gap(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<Options>();
  auto* command = program.add_subcommand(
      "gap",
      "Say where measured power departs from the robot's model, which effects cause it and what remains");
  auto* logs = command->add_option("log", options->logs, "LCM event logs of one robot");
  auto* robot = command->add_option("--robot", options->robot_file, "robot file: the model");
  command->add_option("--robot-id", options->robot_id, "which robot, where the logs hold several");
  command->add_flag("--json", options->json, "print the diagnosis as JSON");
  command->add_option("--apply", options->apply, "write the robot file with the effects found");
  add_gap_trial(*command, exit);
  command->callback([options, command, logs, robot, &exit] {
    if (!command->get_subcommands().empty()) return;
    // Not required() by the parser, which would ask for them of the subcommands too.
    for (const CLI::Option* needed : {logs, robot}) {
      if (needed->empty()) throw CLI::RequiredError(needed->get_name());
    }
    exit = run(*options);
  });
}

}  // namespace joulecast::client
