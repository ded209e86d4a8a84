#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/error.h"
#include "robot/robot_model.h"
#include "tests/study/trial/trial_case.h"

namespace joulecast::trial {

// Where one case lies on disk.
struct CaseFiles {
  std::filesystem::path folder;
  std::filesystem::path log() const { return folder / "telemetry.lcmlog"; }
  std::filesystem::path robot() const { return folder / "robot.json"; }
  std::filesystem::path truth() const { return folder / "truth.json"; }
};

// The content of a truth file.
struct SealedTruth {
  Kind kind = Kind::none;
  Strength strength = Strength::slight;
  std::string robot_kind;
  bool motor_channels = true;
  std::vector<std::string> variants;
  double added_gap = 0;
  // Ids with strengths and, for effects of the catalogue, shapes by the names of their parameters; the first
  // is the strength.
  std::vector<robot::AdoptedEffect> effects;
};

// Drives the missions and writes robot file, event log and truth. Returns a digest of the three (FNV-1a), by
// which two runs can be compared.
[[nodiscard]] Result<std::uint64_t> drive_case(const TrialCase& trial_case, const CaseFiles& files);

// Digest of these files in this order.
[[nodiscard]] Result<std::uint64_t> digest_of_files(const std::vector<std::filesystem::path>& paths);
// The same of a case's files that lie there already.
[[nodiscard]] Result<std::uint64_t> digest_of(const CaseFiles& files);

[[nodiscard]] Result<SealedTruth> open_truth(const std::filesystem::path& path);

}  // namespace joulecast::trial
