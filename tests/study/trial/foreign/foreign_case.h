#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "tests/study/trial/case_files.h"
#include "tests/study/trial/foreign/foreign_plant.h"
#include "tests/study/trial/trial_case.h"

namespace joulecast::trial::foreign {

// A robot file as drawn, and as JSON.
[[nodiscard]] ForeignRobot draw_robot_file(virtual_robot::Rng& rng);
[[nodiscard]] std::string robot_json_text(const ForeignRobot& robot);

// One case as drawn; the same seed and index give the same case.
struct ForeignCase {
  std::size_t index = 0;
  Kind kind = Kind::none;
  ForeignRobot file, built;  // the robot file; the robot that is driven, within calibration of it
  Departures with;
  std::vector<std::pair<std::string, double>> effects;  // ids with strengths
  double gap = 0;                                       // added absolute power, relative, of all together
  double sample_period_s = 0.05;
  std::vector<Drive> drives;
  std::uint64_t noise_seed = 0;
};

[[nodiscard]] ForeignCase draw_foreign_case(std::uint64_t seed, std::size_t index);

// Writes robot file, event log and truth; returns their digest. Without motor channels their readings are
// unmeasured.
[[nodiscard]] Result<std::uint64_t> write_foreign_case(const ForeignCase& drawn, bool motor_channels,
                                                       const CaseFiles& files);

}  // namespace joulecast::trial::foreign
