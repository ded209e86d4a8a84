#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "tests/study/trial/trial_case.h"

// Cases that are kept as lines of JSON: their source, a digest of their files and their truth. No
// readings.
namespace joulecast::trial::kept {

struct PlantedEffect {
  std::string id;
  std::optional<double> strength;  // in the catalogue's units; none where its form is not the catalogue's
};

// An effect that an answer may name; with a range, only at a strength within it.
struct Expected {
  std::string id;
  std::optional<double> from, to;
};

struct KeptTruth {
  std::optional<Kind> kind;            // of planted cases
  std::vector<PlantedEffect> effects;  // of planted cases
  double gap = 0;                      // added absolute power, relative
  // Of real recordings: effects that are there, effects that neither help nor mislead, and regular
  // expressions for right and refuted variables of "outside", and for right corrections.
  std::vector<Expected> right, neutral;
  std::string outside, refuted, corrections;
  std::string other;  // the case of the other half of a recording
};

struct KeptCase {
  std::string id;
  std::string group;       // recorded_motion, virtual_robots, foreign_plant, or another one of recordings
  std::string channels;    // all, battery (no motor channels) or recorded
  std::uint64_t seed = 0;  // of generated cases, with the index
  std::size_t index = 0;
  std::string recording;  // folder of the others, below that of all recordings
  std::string digest;     // empty: not made yet
  std::optional<KeptTruth> truth;
};

// The cases of a file, in its order. A line with "count" gives that many cases of one seed.
// Fault::corrupt names the line.
[[nodiscard]] Result<std::vector<KeptCase>> read_cases(const std::filesystem::path& path);

[[nodiscard]] nlohmann::json case_line(const KeptCase& kept);

// The first `count` cases of every group and channel set.
[[nodiscard]] std::vector<KeptCase> sample_of(const std::vector<KeptCase>& cases, std::size_t count);

}  // namespace joulecast::trial::kept
