#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gap/verdict/diagnosis.h"
#include "tests/study/trial/case_files.h"

namespace joulecast::trial {

// What the diagnosis said of one case, and the truth that was opened afterwards.
struct CaseOutcome {
  std::size_t index = 0;
  std::uint64_t digest = 0;  // of the files of the case
  SealedTruth truth;
  gap::Diagnosis diagnosis;
  std::optional<double> oracle;  // shrinkage that knowing the truth would reach
  double diagnosis_s = 0;        // processor time
  // What other ways of judging the same log said, by name.
  std::vector<std::pair<std::string, gap::Diagnosis>> others;
};

[[nodiscard]] bool holds(const SealedTruth& truth, std::string_view id);

// The verdict that the truth asks for, with every effect named (or in the named group) and none more.
[[nodiscard]] bool exactly_right(const CaseOutcome& outcome);
// Single effects: what is named first is it, or its group holds it.
[[nodiscard]] bool first_right(const CaseOutcome& outcome);

}  // namespace joulecast::trial
