#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/commands.h"

// Assignment of robots to the daemons of a cluster, agreed on in PostgreSQL (schemas/cluster.postgresql.sql).
// A daemon is a member as long as it renews its row; a robot's lease belongs to a member as long as that row
// exists. Commits carry the lease's epoch (commands.h), which increases each time the lease is taken: a
// daemon that lost the lease without noticing cannot write.
namespace joulecast::history {

struct Member {
  std::string node;
  std::int64_t incarnation = 0;
  std::string writer;   // the name under which it writes to the store
  std::string address;  // where it answers
  std::string version;
  double joined_s = 0;      // ago
  double expires_in_s = 0;  // negative: it has not renewed
  bool connected = true;    // its connection is there, or the server is another one than it last renewed at
};

struct Lease {
  std::string robot_id;
  std::string node;  // empty: released
  Epoch epoch = 0;
  double taken_s = 0;  // ago
  std::int64_t takeovers = 0;
  std::optional<StreamPosition> position;
};

// That a member receives a robot's telemetry.
struct Hearing {
  std::string node, robot_id;
  double since_s = 0;  // ago
};

struct ClusterState {
  std::vector<Member> members;
  std::vector<Hearing> hearings;
  std::vector<Lease> leases;
};

struct LeaseOptions {
  std::string url;
  std::string cluster, node, address, version;
  std::string writer;
  std::chrono::milliseconds lifetime{5000};  // of a membership that is not renewed
};

// One member, on a connection of its own that no writer delays; used by one thread. Fault::unavailable: the
// database is not reached for now.
class Leases {
 public:
  virtual ~Leases() = default;

  // Begins a new membership, ending an earlier one of the node's name that has lapsed. Fault::conflict:
  // another program is a member under that name, or the daemons of this store are called otherwise.
  virtual Result<void> join() = 0;
  // Fault::conflict: the membership was ended, and the leases are another's.
  virtual Result<void> renew() = 0;
  virtual Result<ClusterState> state() = 0;
  // Ends the membership of another node, and its connections, if it has not renewed since it was seen. False
  // if it has.
  virtual Result<bool> bury(const Member& member) = 0;
  // Reports the robots from which telemetry is received, in addition to those reported before.
  virtual Result<void> hear(const std::vector<std::string>& more,
                            const std::vector<std::string>& no_longer) = 0;
  // Takes leases that are free by now, as they were seen; returns those that it got, with their new epochs. A
  // robot without a lease is seen with epoch 0.
  virtual Result<std::vector<Lease>> take(const std::vector<Lease>& seen) = 0;
  // Releases leases of this node, as they were seen.
  virtual Result<void> free(const std::vector<Lease>& seen) = 0;
  // Takes diagnoses that ended daemons have left waiting or running; returns their ids.
  virtual Result<std::vector<std::int64_t>> take_jobs() = 0;
  // Ends the membership. Its leases become free.
  virtual Result<void> leave() = 0;
};

std::unique_ptr<Leases> open_leases(LeaseOptions options);

}  // namespace joulecast::history
