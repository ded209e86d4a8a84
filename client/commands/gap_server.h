#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "client/commands/outcome.h"
#include "gap/verdict/offer.h"

namespace joulecast::client {

struct GapServerOptions {
  std::string server;
  std::string robot_id;
  std::size_t max_missions = 200;
  std::string report;  // file for the HTML report; empty: none
  std::string apply;   // file for the robot file with the effects found; empty: none
  gap::Choice choice;  // of effects that cannot be distinguished; with force also refused ones
  bool json = false;
  bool adopt = false;  // in the daemon, after a back-test
};

// Starts a diagnosis of a daemon's own history of a robot, follows the job and prints its result. An
// interrupt cancels the job.
Exit gap_from_server(const GapServerOptions& options);

}  // namespace joulecast::client
