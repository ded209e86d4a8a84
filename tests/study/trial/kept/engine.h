#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "base/error.h"
#include "tests/study/trial/motion/judged.h"

namespace joulecast::trial::kept {

// The answer that a line of JSON contains: {"verdict", "verdict_probability", "causes": [{"effect",
// "probability", "strength", "sd", "alternatives"}], "outside": {"channel", "follows"}, "corrections":
// [{"channel", "kind", "probability"}], "held_out": {"unchanged", "explanation", "regression"}}. All but
// "verdict" and "causes", and of a cause all but its id, may be missing. Causes are put in order of their
// probability. Fault::corrupt for a line that is not such an answer.
struct EngineAnswer : motion::Answer {
  struct Correction {
    std::string text;  // channel and kind
    double probability = 1;
  };
  std::vector<Correction> corrections;
};
[[nodiscard]] Result<EngineAnswer> parse_answer(std::string_view line);

[[nodiscard]] nlohmann::json answer_line(const motion::Answer& answer);

// The answer of one engine to a log and a robot file, with its processor time; an engine that fails is an
// answer too, with the reason in "refused". Without a command the diagnosis that is built in.
struct Engine {
  std::string command;
};
[[nodiscard]] Result<nlohmann::json> ask(const Engine& engine, const std::filesystem::path& log,
                                         const std::filesystem::path& robot);

}  // namespace joulecast::trial::kept
