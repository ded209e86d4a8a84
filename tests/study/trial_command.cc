#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/nearest_word.h"
#include "client/commands/option.h"
#include "tests/study/cases_command.h"
#include "tests/study/motion_command.h"
#include "tests/study/outcome_lines.h"
#include "tests/study/study_commands.h"
#include "tests/study/trial/run.h"
#include "tests/study/trial/score_text.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::client {
namespace {

struct TrialCommandOptions {
  trial::RunSettings run;
  std::string only;
  std::string channels = "mixed";
  std::string keep, again, motion, outcomes;
  CasesOptions cases;
  bool json = false;
  bool usual_plant = false;
  bool residuals_in_place = false;
};

// One line a case on a terminal or in a log; nothing of it on standard output, which holds the answer.
void show(const trial::CaseOutcome& outcome, std::size_t finished, std::size_t count) {
  std::fprintf(stderr, "[%zu/%zu] %s\n", finished, count, trial::case_text(outcome).c_str());
}

Exit run(TrialCommandOptions& options) {
  trial::TrialSettings& t = options.run.trial;
  if (!options.cases.cases.empty()) {
    options.cases.keep = options.keep;
    options.cases.jobs = options.run.jobs;
    options.cases.json = options.json;
    return run_cases_of(options.cases);
  }
  if (!options.motion.empty() || holds_motion_cases(options.again)) {
    return run_motion({options.motion, options.only, options.again.empty() ? options.keep : options.again,
                       !options.again.empty(), t.seed, t.count, options.run.jobs, options.outcomes,
                       options.json, options.residuals_in_place});
  }
  if (!options.only.empty()) {
    t.only = trial::kind_of(options.only == "double" ? "pair" : options.only);
    const auto known = virtual_robot::effect_table();
    if (!t.only && std::ranges::find(known, options.only, &virtual_robot::EffectEntry::id) == known.end()) {
      return report({Fault::invalid, "--only",
                     options.only + " is neither a kind of case nor an effect" +
                         did_you_mean(options.only, known, &virtual_robot::EffectEntry::id)});
    }
    if (!t.only) t.only_effect = options.only;
  }
  t.channels = options.channels == "full"      ? trial::ChannelChoice::full
               : options.channels == "battery" ? trial::ChannelChoice::battery
                                               : trial::ChannelChoice::mixed;
  t.vary_plant = !options.usual_plant;
  options.run.keep = options.keep;
  options.run.again = !options.again.empty();
  if (options.run.again) options.run.keep = options.again;
  auto lines = OutcomeLines::open(options.outcomes);
  if (!lines) return report(lines.error());
  std::size_t finished = 0;
  options.run.done = [&](const trial::CaseOutcome& outcome) {
    show(outcome, ++finished, t.count);
    lines->add(trial::case_json(outcome));
  };

  const auto outcomes = trial::run_trial(options.run);
  if (!outcomes) return report(outcomes.error());
  if (auto done = lines->close(); !done) return report(done.error());
  const trial::Score score = trial::score_of(*outcomes);
  const auto rows = options.run.compare ? trial::compare(*outcomes) : std::vector<trial::ComparisonRow>{};
  if (options.json) {
    nlohmann::json cases = nlohmann::json::array();
    for (const auto& outcome : *outcomes) cases.push_back(trial::case_json(outcome));
    nlohmann::json answer{
        {"seed", t.seed}, {"count", t.count}, {"score", trial::score_json(score)}, {"cases", cases}};
    if (!rows.empty()) answer["comparison"] = trial::comparison_json(rows);
    std::printf("%s\n", answer.dump(2).c_str());
  } else {
    std::printf("%s", trial::score_text(score).c_str());
    if (!rows.empty()) std::printf("\n%s", trial::comparison_text(rows).c_str());
  }
  return Exit::ok;
}

// The options for kept cases.
void add_cases(CLI::App& command, CasesOptions& options) {
  auto* cases =
      command.add_option("--cases", options.cases, "score an engine on the kept cases of this file")
          ->type_name("FILE");
  const auto add = [&](const char* name, std::string& value, const char* text, const char* type) {
    command.add_option(name, value, text)->type_name(type)->needs(cases);
  };
  add("--recordings", options.recordings, "with --cases: folder of the recordings that cases name", "FOLDER");
  add("--engine", options.engine,
      "with --cases: run 'COMMAND LOG --robot FILE' for each case in place of the built-in diagnosis; it "
      "prints one "
      "line of JSON: {\"verdict\": none, effects, outside, not_this_robot or inconclusive, "
      "\"verdict_probability\", "
      "\"causes\": [{\"effect\", \"probability\", \"strength\", \"sd\", \"alternatives\": [ids]}], "
      "\"outside\": "
      "{\"channel\", \"follows\"}, \"corrections\": [{\"channel\", \"kind\", \"probability\"}], "
      "\"held_out\": "
      "{\"unchanged\", \"explanation\", \"regression\"}}, errors relative to the power of held-out parts",
      "COMMAND");
  add("--answers", options.answers,
      "with --cases: keep an answer a line in this file; cases that it answers are not run again", "FILE");
  add("--against", options.against,
      "with --cases: compare with the answers of this file, on cases that both answer", "FILE");
  add("--record", options.record,
      "with --cases: make the cases, write them to this file with digests and truths, and run no engine",
      "FILE");
  command.add_option("--sample", options.sample, "with --cases: the first N of each group and channel set")
      ->type_name("N")
      ->needs(cases);
  command.add_flag("--kept-only", options.kept_only, "with --cases: score kept answers and run nothing")
      ->needs(cases);
}

}  // namespace

void add_trial(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<TrialCommandOptions>();
  auto* command = program.add_subcommand("trial",
                                         "Put known effects into virtual robots or into recorded motion, "
                                         "diagnose the logs blindly and score the answers");
  add_option(*command, "--count", options->run.trial.count, "cases", between(1, 100'000));
  command->add_option("--seed", options->run.trial.seed, "the same seed gives the same cases, bit for bit")
      ->capture_default_str();
  add_option(*command, "--jobs", options->run.jobs, "cases in parallel", between(1, 64));
  command
      ->add_option("--only", options->only, "none, single, double, outside, or the id of one effect or load")
      ->type_name("KIND");
  auto* channels =
      add_option(*command, "--channels", options->channels, "full, battery (no motor channels) or mixed",
                 one_of({"full", "battery", "mixed"}));
  auto* usual = command->add_flag("--usual-plant", options->usual_plant,
                                  "leave out the sensors, drives and missions unlike the usual");
  auto* compare =
      command->add_flag("--compare", options->run.compare,
                        "diagnose every log also with simpler methods, and with the ablated method");
  auto* motion =
      command
          ->add_option("--motion", options->motion,
                       "folder of event logs with battery power: effects are planted into their motion; "
                       "NAME.json next to NAME.lcmlog gives the robot's wheels")
          ->type_name("FOLDER")
          ->excludes(channels)
          ->excludes(usual)
          ->excludes(compare);
  command
      ->add_flag(
          "--residuals-in-place", options->residuals_in_place,
          "with --motion: a log's residuals of the regression stay where they were recorded, and are not "
          "resampled")
      ->needs(motion);
  command
      ->add_option("--outcomes", options->outcomes, "file to which a line of JSON is added as each case ends")
      ->type_name("FILE");
  command->add_option("--keep", options->keep, "folder that keeps robot files, logs and truths of all cases")
      ->type_name("FOLDER");
  command
      ->add_option("--again", options->again,
                   "diagnose the first --count cases from an earlier --keep in this folder; nothing is drawn")
      ->type_name("FOLDER")
      ->excludes("--keep");
  command->add_flag("--json", options->json, "print scores and cases as JSON");
  add_cases(*command, options->cases);
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client
