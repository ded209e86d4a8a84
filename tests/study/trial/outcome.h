#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gap/verdict/diagnosis.h"
#include "tests/study/trial/case_files.h"

namespace joulecast::trial {

// The diagnosis of one case, and the truth, which was opened afterwards.
struct CaseOutcome {
  std::size_t index = 0;
  std::uint64_t digest = 0;  // of the files of the case
  SealedTruth truth;
  gap::Diagnosis diagnosis;
  std::optional<double> oracle;  // shrinkage that knowing the truth would reach
  double diagnosis_s = 0;        // processor time
  // Diagnoses of the same log by other methods, by name.
  std::vector<std::pair<std::string, gap::Diagnosis>> others;
};

[[nodiscard]] bool holds(const SealedTruth& truth, std::string_view id);

// The correct verdict, with every effect named (or in the named group) and no other one.
[[nodiscard]] bool exactly_right(const CaseOutcome& outcome);
// Single effects: the first name is it, or its group contains it.
[[nodiscard]] bool first_right(const CaseOutcome& outcome);

}  // namespace joulecast::trial
