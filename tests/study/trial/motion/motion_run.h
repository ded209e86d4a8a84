#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "base/error.h"
#include "tests/study/trial/motion/judged.h"
#include "tests/study/trial/motion/motion_case.h"

namespace joulecast::trial::motion {

// The diagnosis of one case, and the truth, which was opened afterwards.
struct MotionOutcome {
  std::size_t index = 0;
  std::uint64_t digest = 0;  // of the files of the case
  MotionTruth truth;
  Answer answer;
  // Mean absolute errors over the mean absolute power, at the instants of the made recording: of the best
  // plain regression on blocks that it was not fitted to, of the robot file with the effects that the
  // diagnosis would adopt, and of the unchanged robot file.
  double referee_error = 0, explanation_error = 0, unchanged_error = 0;
};

struct MotionRunSettings {
  MotionSettings trial;
  std::size_t jobs = 1;
  std::filesystem::path keep;  // folder that takes robot files, logs and truths; empty: all are removed
  bool again = false;          // diagnose the cases already in `keep`; nothing is drawn
  std::function<void(const MotionOutcome&)> done;  // called after each case, by one thread at a time
};

// Draws, makes, diagnoses from the log and the robot file alone, then opens the truth. The outcomes are in
// order of the cases and do not depend on `jobs`. `logs` may be empty when judging again.
[[nodiscard]] Result<std::vector<MotionOutcome>> run_motion_trial(const MotionRunSettings& settings,
                                                                  std::span<const BaseLog> logs);

}  // namespace joulecast::trial::motion
