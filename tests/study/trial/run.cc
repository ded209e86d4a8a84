#include "tests/study/trial/run.h"

#include <string>
#include <utility>

#include "robot/robot_file.h"
#include "tests/study/trial/ablations.h"
#include "tests/study/trial/baselines.h"
#include "tests/study/trial/case_pool.h"
#include "tests/study/trial/oracle.h"

namespace joulecast::trial {
namespace {

Result<CaseOutcome> run_case(const RunSettings& settings, std::size_t index, const CaseFiles& files) {
  CaseOutcome outcome;
  outcome.index = index;
  const auto digest = settings.again ? digest_of(files) : drive_case(draw_case(settings.trial, index), files);
  if (!digest) return tl::unexpected(digest.error());
  outcome.digest = *digest;

  // As `joulecast gap LOG --robot FILE`, with no other input.
  const double began_s = thread_cpu_s();
  const auto robot = robot::load_robot(files.robot());
  if (!robot) return tl::unexpected(robot.error());
  const std::string log = files.log().string();
  const auto recordings = telemetry::load_recordings({&log, 1});
  if (!recordings) return tl::unexpected(recordings.error());
  auto diagnosis = gap::diagnose(*recordings, *robot);
  if (!diagnosis) return tl::unexpected(diagnosis.error());
  outcome.diagnosis = std::move(*diagnosis);
  outcome.diagnosis_s = thread_cpu_s() - began_s;

  if (settings.compare) {
    for (const Baseline baseline : baselines) {
      outcome.others.emplace_back(name_of(baseline), diagnose_by(baseline, *recordings, *robot));
    }
    for (const Ablation ablation : ablations) {
      auto without = diagnose_without(ablation, *recordings, *robot);
      if (!without) return tl::unexpected(without.error());
      outcome.others.emplace_back(name_of(ablation), std::move(*without));
    }
  }

  auto truth = open_truth(files.truth());
  if (!truth) return tl::unexpected(truth.error());
  outcome.truth = std::move(*truth);
  outcome.oracle = oracle_shrinkage(*recordings, *robot, outcome.truth);
  return outcome;
}

}  // namespace

Result<std::vector<CaseOutcome>> run_trial(const RunSettings& settings) {
  return run_cases<CaseOutcome>(
      settings.trial.count, settings.jobs, settings.keep,
      [&](std::size_t index, const CaseFiles& files) { return run_case(settings, index, files); },
      settings.done);
}

}  // namespace joulecast::trial
