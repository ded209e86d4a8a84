#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/commands.h"

namespace joulecast::history {

// The live state of a robot as its keeper publishes it to the other daemons of a cluster.
struct LiveState {
  std::string robot_id;
  std::string node;  // its keeper
  Epoch epoch = 0;   // of the keeper's lease: no earlier one's state replaces this one's
  std::vector<std::byte> body;
};

// State that the daemons of a cluster share in addition to the history, on a connection of its own; used by
// one thread. Fault::unavailable: the database cannot be reached at present.
class SharedState {
 public:
  virtual ~SharedState() = default;

  virtual Result<void> put(const std::vector<LiveState>& states) = 0;
  // The states that other nodes put since the last call.
  virtual Result<std::vector<LiveState>> news(const std::string& own_node) = 0;
  // The active version of every robot's model; absent: none.
  virtual Result<std::map<std::string, std::optional<std::int64_t>>> active_models() = 0;
  // For each robot the time of its last training on its missions' legs ("legs"), by the robot's clock.
  virtual Result<std::map<std::string, std::int64_t>> learned(const std::string& topic) = 0;
};

// `application_name` identifies the connection at the server.
std::unique_ptr<SharedState> open_shared_state(const std::string& url, const std::string& application_name);

}  // namespace joulecast::history
