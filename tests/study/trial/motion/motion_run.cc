#include "tests/study/trial/motion/motion_run.h"

#include <cmath>
#include <utility>

#include "robot/robot_file.h"
#include "tests/study/trial/case_pool.h"

namespace joulecast::trial::motion {
namespace {

double relative_error(std::span<const double> power_w, std::span<const double> modelled_w) {
  double missed = 0, total = 0;
  for (std::size_t n = 0; n < power_w.size(); ++n) {
    missed += std::fabs(power_w[n] - modelled_w[n]);
    total += std::fabs(power_w[n]);
  }
  return total > 0 ? missed / total : 0;
}

// The referee reads the made recording without information about the planted effects.
Result<void> measure_errors(const CaseFiles& files, MotionOutcome& outcome) {
  const auto robot = robot::load_robot(files.robot());
  if (!robot) return tl::unexpected(robot.error());
  auto missions = recorded_missions(files.log());
  if (!missions) return tl::unexpected(std::move(missions.error()));
  MotionLog log;
  log.kinematics = *robot;
  log.own_kinematics = true;
  log.missions = std::move(*missions);
  log.battery = battery_channels_of(log.missions);
  log.instants = instants_of(log.missions, robot->kinematics, log.battery.period_s);
  const std::vector<Instant> instants = log.all_instants();
  std::vector<double> power_w;
  power_w.reserve(instants.size());
  for (const Instant& at : instants) power_w.push_back(at.power_w());
  outcome.referee_error = referee_error(base_form_of(log), instants, power_w);
  const auto unchanged_w = modelled_power_w(*robot, instants);
  if (!unchanged_w) return tl::unexpected(unchanged_w.error());
  outcome.unchanged_error = relative_error(power_w, *unchanged_w);
  outcome.explanation_error = outcome.unchanged_error;
  if (outcome.answer.refused.empty()) {
    const auto explained_w = modelled_power_w(outcome.answer.explained, instants);
    if (!explained_w) return tl::unexpected(explained_w.error());
    outcome.explanation_error = relative_error(power_w, *explained_w);
  }
  return {};
}

Result<MotionOutcome> run_case(const MotionRunSettings& settings, std::span<const BaseLog> logs,
                               std::size_t index, const CaseFiles& files) {
  MotionOutcome outcome;
  outcome.index = index;
  const auto digest = settings.again
                          ? digest_of(files)
                          : write_motion_case(draw_motion_case(settings.trial, logs, index), files);
  if (!digest) return tl::unexpected(digest.error());
  outcome.digest = *digest;
  auto answer = judge(files.log(), files.robot());
  if (!answer) return tl::unexpected(std::move(answer.error()));
  outcome.answer = std::move(*answer);
  if (auto done = measure_errors(files, outcome); !done) return tl::unexpected(std::move(done.error()));
  auto truth = open_motion_truth(files.truth());
  if (!truth) return tl::unexpected(std::move(truth.error()));
  outcome.truth = std::move(*truth);
  return outcome;
}

}  // namespace

Result<std::vector<MotionOutcome>> run_motion_trial(const MotionRunSettings& settings,
                                                    std::span<const BaseLog> logs) {
  return run_cases<MotionOutcome>(
      settings.trial.count, settings.jobs, settings.keep,
      [&](std::size_t index, const CaseFiles& files) { return run_case(settings, logs, index, files); },
      settings.done);
}

}  // namespace joulecast::trial::motion
