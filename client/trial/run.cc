#include "client/trial/run.h"

#include <time.h>

#include <atomic>
#include <cstdio>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <thread>

#include "client/trial/ablations.h"
#include "client/trial/baselines.h"
#include "client/trial/oracle.h"
#include "robot/robot_file.h"

namespace joulecast::trial {
namespace {

double thread_cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Removes the folder of a case that nobody wants to keep.
class Scratch {
 public:
  Scratch(std::filesystem::path folder, bool keep) : folder_(std::move(folder)), keep_(keep) {}
  ~Scratch() {
    std::error_code ignored;
    if (!keep_) std::filesystem::remove_all(folder_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

 private:
  std::filesystem::path folder_;
  bool keep_;
};

Result<CaseOutcome> run_case(const RunSettings& settings, const std::filesystem::path& root,
                             std::size_t index) {
  char name[32];
  std::snprintf(name, sizeof name, "case-%04zu", index);
  const CaseFiles files{root / name};
  const Scratch scratch(files.folder, !settings.keep.empty());

  CaseOutcome outcome;
  outcome.index = index;
  const auto digest = settings.again ? digest_of(files) : drive_case(draw_case(settings.trial, index), files);
  if (!digest) return tl::unexpected<Error>(digest.error());
  outcome.digest = *digest;

  // As `joulecast gap LOG --robot FILE` does: nothing else is read.
  const double began_s = thread_cpu_s();
  const auto robot = robot::load_robot(files.robot());
  if (!robot) return tl::unexpected<Error>(robot.error());
  const std::string log = files.log().string();
  const auto recordings = telemetry::load_recordings({&log, 1});
  if (!recordings) return tl::unexpected<Error>(recordings.error());
  auto diagnosis = gap::diagnose(*recordings, *robot);
  if (!diagnosis) return tl::unexpected<Error>(diagnosis.error());
  outcome.diagnosis = std::move(*diagnosis);
  outcome.diagnosis_s = thread_cpu_s() - began_s;

  if (settings.compare) {
    for (const Baseline baseline : baselines) {
      outcome.others.emplace_back(name_of(baseline), diagnose_by(baseline, *recordings, *robot));
    }
    for (const Ablation ablation : ablations) {
      auto without = diagnose_without(ablation, *recordings, *robot);
      if (!without) return tl::unexpected<Error>(without.error());
      outcome.others.emplace_back(name_of(ablation), std::move(*without));
    }
  }

  auto truth = open_truth(files.truth());
  if (!truth) return tl::unexpected<Error>(truth.error());
  outcome.truth = std::move(*truth);
  outcome.oracle = oracle_shrinkage(*recordings, *robot, outcome.truth);
  return outcome;
}

Result<std::filesystem::path> make_root(const std::filesystem::path& keep) {
  if (!keep.empty()) return keep;
  std::string pattern = (std::filesystem::temp_directory_path() / "joulecast-trial-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) {
    return fail(Fault::unavailable, pattern, "cannot make a folder for the logs");
  }
  return std::filesystem::path(pattern);
}

}  // namespace

Result<std::vector<CaseOutcome>> run_trial(const RunSettings& settings) {
  const auto root = make_root(settings.keep);
  if (!root) return tl::unexpected<Error>(root.error());
  const Scratch scratch(*root, !settings.keep.empty());

  std::vector<CaseOutcome> outcomes(settings.trial.count);
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::optional<Error> error;
  const auto work = [&] {
    for (std::size_t k = next++; k < outcomes.size(); k = next++) {
      auto outcome = run_case(settings, *root, k);
      const std::lock_guard lock(mutex);
      if (!outcome) {
        if (!error) error = outcome.error();
        next = outcomes.size();
        return;
      }
      outcomes[k] = std::move(*outcome);
      if (settings.done) settings.done(outcomes[k]);
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (std::size_t k = 1; k < settings.jobs; ++k) helpers.emplace_back(work);
    work();
  }
  if (error) return tl::unexpected<Error>(*error);
  return outcomes;
}

}  // namespace joulecast::trial
