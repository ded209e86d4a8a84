#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "client/commands/option.h"

namespace joulecast::client {

struct MotionTrialOptions {
  std::string logs;  // folder; not read when judging again
  std::string only;  // kind of case or id; empty: all
  std::string keep;  // folder of the cases
  bool again = false;
  std::uint64_t seed = 1;
  std::size_t count = 0, jobs = 1;
  std::string outcomes;  // file that takes a line for each case; empty: none
  bool json = false;
  bool residuals_in_place = false;
};

// Whether an earlier --keep of such a trial left its cases in this folder.
bool holds_motion_cases(const std::string& folder);

// `joulecast-study trial --motion FOLDER`.
Exit run_motion(const MotionTrialOptions& options);

}  // namespace joulecast::client
