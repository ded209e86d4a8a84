#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"
#include "tests/study/trial/motion/motion_log.h"

// The interface of the trial on real motion to the diagnosis under test.
namespace joulecast::trial::motion {

struct NamedEffect {
  std::string id;
  double probability = 0;
  std::vector<std::string> alternatives;  // that the data cannot distinguish from it
  double strength = 0, deviation = 0;
  double group = 0;  // probability of it or of one of its alternatives
};

struct Answer {
  std::string refused;  // why nothing was answered; empty: there is an answer
  std::string verdict;
  double verdict_probability = 0;
  std::vector<NamedEffect> effects;  // likeliest first
  std::string outside_channel, outside_follows;
  double gap = 0, noise_floor = 0;          // absolute, relative to the power measured
  std::optional<double> referee_error;      // of its own plain regression, on data held out
  std::optional<double> explanation_error;  // of its explanation, on the same
  std::optional<double> unchanged_error;    // of the robot file, on the same
  robot::RobotModel explained;              // the robot file with the adoptable effects
  double processor_s = 0;
};

// The missions of a log as the diagnosis reads them.
[[nodiscard]] Result<std::vector<telemetry::Recording>> recorded_missions(const std::filesystem::path& log);

// The answer of `joulecast gap LOG --robot FILE`, with no other input. A refusal by the diagnosis is an
// answer too.
[[nodiscard]] Result<Answer> judge(const std::filesystem::path& log, const std::filesystem::path& robot_file);

// Battery power as the product's drive model has it for a robot file at each instant [W].
[[nodiscard]] Result<std::vector<double>> modelled_power_w(const robot::RobotModel& robot,
                                                           std::span<const Instant> instants);

}  // namespace joulecast::trial::motion
