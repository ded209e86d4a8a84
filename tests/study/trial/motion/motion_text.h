#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "tests/study/trial/motion/motion_score.h"

namespace joulecast::trial::motion {

// The logs that cases are drawn on, with base power and mismatch, one line each.
[[nodiscard]] std::string base_logs_text(std::span<const BaseLog> logs,
                                         const std::vector<std::string>& skipped);
[[nodiscard]] nlohmann::json base_logs_json(std::span<const BaseLog> logs);

[[nodiscard]] std::string motion_score_text(const MotionScore& score);
[[nodiscard]] nlohmann::json motion_score_json(const MotionScore& score);

// One line of a case: right or not, truth, answer.
[[nodiscard]] std::string motion_case_text(const MotionOutcome& outcome);
[[nodiscard]] nlohmann::json motion_case_json(const MotionOutcome& outcome);

}  // namespace joulecast::trial::motion
