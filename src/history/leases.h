#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/commands.h"
#include "history/sql_store.h"

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

// A connection to a PostgreSQL of its own, which no writer delays, made again when it is lost; of one thread.
class OwnConnection {
 protected:
  // `name` identifies it at the server; `settings` are statements for a new connection.
  OwnConnection(std::string url, std::string name, std::string settings);
  ~OwnConnection();

  // Fault::unavailable: the database is not reached for now.
  template <class Work>
  auto work(Work work) -> decltype(work(std::declval<Database&>())) {
    return guarded([&] { return work(connected()); });
  }

 private:
  Database& connected();

  const std::string url_, name_, settings_;
  std::unique_ptr<Database> database_;
};

// One member of a cluster.
class Leases : OwnConnection {
 public:
  explicit Leases(LeaseOptions options);

  // Begins a new membership, ending an earlier one of the node's name that has lapsed. Fault::conflict:
  // another program is a member under that name, or the daemons of this store are called otherwise.
  Result<void> join();
  // Fault::conflict: the membership was ended, and the leases are another's.
  Result<void> renew();
  Result<ClusterState> state();
  // Ends another node's membership and connections if it has not renewed since it was seen. False if it has.
  Result<bool> bury(const Member& member);
  // Reports the robots from which telemetry is received, in addition to those reported before.
  Result<void> hear(const std::vector<std::string>& more, const std::vector<std::string>& no_longer);
  // Takes leases that are free by now, as they were seen; returns those that it got, with their new epochs. A
  // robot without a lease is seen with epoch 0.
  Result<std::vector<Lease>> take(const std::vector<Lease>& seen);
  // Releases leases of this node, as they were seen.
  Result<void> free(const std::vector<Lease>& seen);
  // Takes diagnoses that ended daemons have left waiting or running; returns their ids.
  Result<std::vector<std::int64_t>> take_jobs();
  // Ends the membership. Its leases become free.
  Result<void> leave();

 private:
  const LeaseOptions options_;
  std::int64_t incarnation_ = 0;
};

// The live state of a robot as its keeper publishes it to the other daemons of a cluster.
struct LiveState {
  std::string robot_id;
  std::string node;  // its keeper
  Epoch epoch = 0;   // of the keeper's lease: no earlier one's state replaces this one's
  std::vector<std::byte> body;
};

// State that the daemons of a cluster share in addition to the history.
class SharedState : OwnConnection {
 public:
  SharedState(std::string url, std::string name) : OwnConnection(std::move(url), std::move(name), settings) {}

  Result<void> put(const std::vector<LiveState>& states);
  // The states that other nodes put since the last call.
  Result<std::vector<LiveState>> news(const std::string& own_node);
  // The active version of every robot's model; absent: none.
  Result<std::map<std::string, std::optional<std::int64_t>>> active_models();
  // For each robot the time of its last training on its missions' legs ("legs"), by the robot's clock.
  Result<std::map<std::string, std::int64_t>> learned(const std::string& topic);

 private:
  struct Mark {
    Epoch epoch = 0;
    std::int64_t number = 0;
    bool operator==(const Mark&) const = default;
  };
  // Live states are published again in a moment: a commit need not wait for the disk.
  static constexpr const char* settings = "SET synchronous_commit = off; SET statement_timeout = '5s'";

  std::map<std::string, Mark> seen_;
};

}  // namespace joulecast::history
