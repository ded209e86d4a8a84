#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "tests/study/trial/case_files.h"
#include "tests/study/trial/motion/base_robot.h"
#include "tests/study/trial/motion/plant.h"

namespace joulecast::trial::motion {

// A log ready for cases: its base power and the robot file that has it.
struct BaseLog {
  MotionLog log;
  BaseFit fit;
  robot::RobotModel file;
  double mismatch = 0;  // of the file against the base power, relative
  double residual = 0;  // mean absolute residual over the mean absolute base power
};

// The logs of a folder in order of their names; those that cannot serve are named with the reason in
// `skipped`. Fault::not_found without a folder, Fault::infeasible when none can serve.
[[nodiscard]] Result<std::vector<BaseLog>> read_base_logs(const std::filesystem::path& folder,
                                                          std::vector<std::string>& skipped);

// Added absolute power gap of each planted effect.
inline constexpr std::array gap_classes{0.03, 0.06, 0.10, 0.20};

struct MotionSettings {
  std::uint64_t seed = 1;
  std::size_t count = 40;
  std::optional<Kind> only;
  std::string only_effect;          // an id of forms() or of an outside load
  bool residuals_in_place = false;  // not resampled
};

struct TrueEffect {
  std::string id, form;
  bool catalogue = true;  // the form is the catalogue's
  double strength = 0, gap = 0;
  std::string nearest;  // the other effect of the catalogue that adds power most alike on this motion
  double likeness = 0;  // to it, 0 to 1
};

struct MotionTruth {
  Kind kind = Kind::none;
  std::string log;
  double gap_class = 0;  // of each effect; 0 without one
  std::vector<TrueEffect> effects;
};

// One case as drawn; the same settings, logs and index give the same case, independent of other draws.
struct MotionCase {
  std::size_t index = 0;
  const BaseLog* base = nullptr;
  MotionTruth truth;
  Scene scene;
  std::vector<Planted> planted;
  std::vector<double> outside_w;            // for all instants of the log; empty without
  std::optional<std::uint64_t> noise_seed;  // of the residuals; without one they stay in place
};
[[nodiscard]] MotionCase draw_motion_case(const MotionSettings& settings, std::span<const BaseLog> logs,
                                          std::size_t index);

// Every id that a case can be drawn with.
[[nodiscard]] std::vector<std::string_view> motion_effect_ids();

// Writes log, robot file and truth as the trial on virtual robots does; returns their digest.
[[nodiscard]] Result<std::uint64_t> write_motion_case(const MotionCase& drawn, const CaseFiles& files);

[[nodiscard]] Result<MotionTruth> open_motion_truth(const std::filesystem::path& path);

}  // namespace joulecast::trial::motion
