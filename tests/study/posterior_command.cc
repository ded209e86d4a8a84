#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/commands/option.h"
#include "client/files.h"
#include "gap/posterior/explain_recordings.h"
#include "gap/verdict/adopt.h"
#include "robot/robot_file.h"
#include "tests/study/study_commands.h"

namespace joulecast::client {
namespace {

using nlohmann::ordered_json;

struct PosteriorOptions {
  std::vector<std::string> logs;
  std::string robot_file, apply;
};

ordered_json number(double v) {
  return std::isfinite(v) ? ordered_json(v) : ordered_json(nullptr);
}

ordered_json to_json(const gap::posterior::ExplainedBy& e) {
  ordered_json parameters = ordered_json::object();
  ordered_json out{{"effect", e.id}, {"probability", e.probability}};
  for (const gap::DiagnosedParameter& p : e.parameters) {
    parameters[p.name] = {{"value", number(p.value)}, {"sd", number(p.deviation)}, {"unit", p.unit}};
    if (!std::isfinite(p.deviation)) continue;
    out["strength"] = number(p.value);
    out["sd"] = number(p.deviation);
    out["unit"] = p.unit;
  }
  out["group"] = e.alternatives;
  out["group_probability"] = e.group;
  out["bagged"] = e.bagged;
  out["constant"] = number(e.constant);
  out["power_share"] = number(e.power_share);
  out["held_out_share"] = number(e.share);
  out["at_bound"] = e.at_bound;
  out["parameters"] = std::move(parameters);
  return out;
}

ordered_json to_json(const gap::posterior::Term& t) {
  return {{"name", t.name},
          {"unit", t.unit},
          {"data", number(t.value)},
          {"sd", number(t.deviation)},
          {"model", number(t.model)},
          {"explained", number(t.explained)},
          {"difference_w", number(t.difference_w)},
          {"difference_sd_w", number(t.deviation_w)}};
}

ordered_json to_json(const gap::TermSum& s) {
  return {{"terms", s.terms},
          {"difference_w", number(s.difference_w)},
          {"deviation_w", number(s.deviation_w)},
          {"effects", s.effects},
          {"parameter", s.parameter},
          {"value", number(s.value)},
          {"sd", number(s.deviation)}};
}

template <class Items>
ordered_json list(const Items& items) {
  ordered_json out = ordered_json::array();
  for (const auto& item : items) out.push_back(to_json(item));
  return out;
}

ordered_json to_json(const gap::posterior::Explained& a, const gap::posterior::Fit& fit) {
  const auto& h = a.held_out;
  return {{"verdict", gap::name_of(a.verdict)},
          {"verdict_probability", a.probability},
          {"none", a.none},
          {"causes", list(a.effects)},
          {"terms", list(a.terms)},
          {"sums", list(a.sums)},
          {"outside",
           {{"variable", a.outside.follows},
            {"channel", a.outside.channel},
            {"probability", a.outside.probability},
            {"power_share", number(a.outside_share)}}},
          {"errors",
           {{"file", h.known ? number(h.file) : nullptr},
            {"explanation", h.known ? number(h.explanation) : nullptr},
            {"regression", h.known ? number(h.regression) : nullptr},
            {"noise", number(a.noise)},
            {"function_file", number(h.function_file)},
            {"function_effects", number(h.function_effects)},
            {"function_all", number(h.function_all)}}},
          {"detectable", number(a.detectable)},
          {"repeats", {{"file", number(a.repeats_file)}, {"left", number(a.repeats_left)}}},
          {"tolerance_factors", a.factors},
          {"rows", fit.data.rows.size()},
          {"blocks", fit.data.blocks},
          {"models", fit.models.size()},
          {"steps", fit.steps},
          {"reasons", a.reasons}};
}

Exit run(const PosteriorOptions& options) {
  const auto robot = robot::load_robot(options.robot_file);
  if (!robot) return report(robot.error());
  const auto recordings = telemetry::load_recordings(options.logs, robot->robot_id);
  if (!recordings) return report(recordings.error());
  const auto fit = gap::posterior::fit_missions(recordings->missions, *robot);
  if (!fit) return report(fit.error());
  const gap::posterior::Explained explained = gap::posterior::explain(**fit);
  std::printf("%s\n", to_json(explained, **fit).dump().c_str());
  if (options.apply.empty()) return Exit::ok;
  if (!explained.adopts) return report({Fault::conflict, "--apply", "the held-out error does not fall"});
  std::vector<robot::AdoptedEffect> found;
  for (const dynamics::ActiveEffect& effect : explained.model) found.push_back(dynamics::adopt(effect));
  const auto extended = gap::with_effects(*robot, found);
  if (!extended) return report(extended.error());
  if (const auto written = write_text_file(options.apply, robot::to_json_text(*extended), Existing::replace);
      !written)
    return report(written.error());
  return Exit::ok;
}

}  // namespace

void add_posterior(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<PosteriorOptions>();
  auto* command = program.add_subcommand(
      "posterior",
      "Explain the gap of event logs by the posterior of effects and print the answer as one line of JSON");
  command->add_option("logs", options->logs, "event logs of one robot")->required()->type_name("LOG");
  command->add_option("--robot", options->robot_file, "robot file")->required()->type_name("FILE");
  command->add_option("--apply", options->apply, "write the robot file with the explanation to FILE")
      ->type_name("FILE");
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client
