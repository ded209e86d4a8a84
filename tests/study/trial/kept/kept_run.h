#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "tests/study/trial/kept/engine.h"
#include "tests/study/trial/kept/kept_case.h"

namespace joulecast::trial::kept {

// Answers by the id of their case.
using Answers = std::map<std::string, EngineAnswer>;

// The answers of a file of lines {"case", "digest", ...}, and the digests of the cases that they are to;
// empty without a file. Fault::conflict where an answer is to another version of one of the cases.
[[nodiscard]] Result<Answers> read_answers(const std::filesystem::path& path,
                                           const std::vector<KeptCase>& cases);

struct KeptRun {
  Engine engine;
  std::filesystem::path recordings;  // contains those of recorded cases, and `motion`
  std::filesystem::path keep;        // receives robot files, logs and truths; empty: all are removed
  std::size_t jobs = 1;
  bool draw_only = false;  // makes the files and runs no engine
  // Called after each case, by one thread at a time, with the line of its answer.
  std::function<void(const KeptCase&, const nlohmann::json&)> done;
};

// Makes the files of each case, fills in its digest and truth where they are missing and runs the engine.
// Fault::conflict where the files of a case are not those of its digest.
[[nodiscard]] Result<void> run_kept(const KeptRun& run, std::vector<KeptCase>& cases);

}  // namespace joulecast::trial::kept
