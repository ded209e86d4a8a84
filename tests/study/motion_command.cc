#include "tests/study/motion_command.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/nearest_word.h"
#include "tests/study/outcome_lines.h"
#include "tests/study/trial/case_pool.h"
#include "tests/study/trial/motion/motion_run.h"
#include "tests/study/trial/motion/motion_text.h"

namespace joulecast::client {

namespace motion = trial::motion;

bool holds_motion_cases(const std::string& folder) {
  return !folder.empty() && motion::open_motion_truth(trial::case_files_in(folder, 0).truth()).has_value();
}

Exit run_motion(const MotionTrialOptions& options) {
  motion::MotionRunSettings run;
  run.trial.seed = options.seed;
  run.trial.count = options.count;
  run.trial.residuals_in_place = options.residuals_in_place;
  run.jobs = options.jobs;
  run.keep = options.keep;
  run.again = options.again;
  if (!options.only.empty()) {
    run.trial.only = trial::kind_of(options.only == "double" ? "pair" : options.only);
    const auto ids = motion::motion_effect_ids();
    const std::vector<std::string> known(ids.begin(), ids.end());
    if (!run.trial.only && std::ranges::find(known, options.only) == known.end()) {
      return report({Fault::invalid, "--only",
                     options.only + " is neither a kind of case nor an effect of the trial on real motion" +
                         did_you_mean(options.only, known)});
    }
    if (!run.trial.only) run.trial.only_effect = options.only;
  }
  std::vector<std::string> skipped;
  std::vector<motion::BaseLog> logs;
  if (!options.again) {
    auto read = motion::read_base_logs(options.logs, skipped);
    if (!read) return report(read.error());
    logs = std::move(*read);
  }
  auto lines = OutcomeLines::open(options.outcomes);
  if (!lines) return report(lines.error());
  std::size_t finished = 0;
  run.done = [&](const motion::MotionOutcome& outcome) {
    std::fprintf(stderr, "[%zu/%zu] %s\n", ++finished, options.count,
                 motion::motion_case_text(outcome).c_str());
    lines->add(motion::motion_case_json(outcome));
  };
  const auto outcomes = motion::run_motion_trial(run, logs);
  if (!outcomes) return report(outcomes.error());
  if (auto done = lines->close(); !done) return report(done.error());
  const motion::MotionScore score = motion::motion_score_of(*outcomes);
  if (!options.json) {
    const std::string about = options.again ? "" : motion::base_logs_text(logs, skipped);
    std::printf("%s%s", about.c_str(), motion::motion_score_text(score).c_str());
    return Exit::ok;
  }
  nlohmann::json cases = nlohmann::json::array();
  for (const auto& outcome : *outcomes) cases.push_back(motion::motion_case_json(outcome));
  const nlohmann::json answer{{"seed", options.seed},
                              {"count", options.count},
                              {"logs", motion::base_logs_json(logs)},
                              {"left_out", skipped},
                              {"score", motion::motion_score_json(score)},
                              {"cases", cases}};
  std::printf("%s\n", answer.dump(2).c_str());
  return Exit::ok;
}

}  // namespace joulecast::client
