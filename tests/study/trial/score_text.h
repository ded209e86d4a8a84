#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tests/study/trial/outcome.h"
#include "tests/study/trial/score.h"

namespace joulecast::trial {

// The score table, confusions, reliability and variants for people.
[[nodiscard]] std::string score_text(const Score& score);
[[nodiscard]] std::string comparison_text(const std::vector<ComparisonRow>& rows);
[[nodiscard]] nlohmann::json comparison_json(const std::vector<ComparisonRow>& rows);
// One line of a case: right or not, truth, answer.
[[nodiscard]] std::string case_text(const CaseOutcome& outcome);

[[nodiscard]] nlohmann::json score_json(const Score& score);
[[nodiscard]] nlohmann::json case_json(const CaseOutcome& outcome);

}  // namespace joulecast::trial
