#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "base/error.h"
#include "gap/diagnose/recordings.h"
#include "tests/study/trial/outcome.h"
#include "tests/study/trial/trial_case.h"

namespace joulecast::trial {

struct RunSettings {
  TrialSettings trial;
  std::size_t jobs = 1;
  std::filesystem::path keep;  // folder that takes robot files, logs and truths; empty: all are removed
  bool again = false;          // diagnose the cases already in `keep`; nothing is drawn or driven
  bool compare = false;        // diagnose every log also with the baselines and with the ablated method
  std::function<void(const CaseOutcome&)> done;  // called after each case, by one thread at a time
};

// Draws, drives, diagnoses from the log and the robot file alone, then opens the truth. The outcomes are in
// order of the cases and do not depend on `jobs`.
[[nodiscard]] Result<std::vector<CaseOutcome>> run_trial(const RunSettings& settings);

}  // namespace joulecast::trial
