#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/error.h"
#include "history/leases.h"
#include "history/store.h"
#include "ingest/fleet_view.h"
#include "ingest/forecasts.h"
#include "ingest/inbound_message.h"
#include "ingest/keeping.h"
#include "ingest/model_registry.h"

namespace joulecast::server {

// A live daemon hands a robot over only to a daemon that has received the robot for this long: its buffer of
// the robot's messages must begin before the other's last commit. A robot without a keeper that no daemon has
// received for this long goes to the daemon that has received it longest.
inline constexpr double settled_s = 3;

// The actions of one daemon on the cluster's robots, from the common state. Rendezvous hashing: of the
// daemons that receive a robot, the one with the greatest hash of its own and the robot's name keeps it. A
// daemon that joins or leaves thus moves only its own share of the robots.
struct Assignment {
  std::vector<history::Lease> take;       // without a holder
  std::vector<history::Lease> hand_over;  // that this daemon holds
  std::vector<history::Lease> free;       // that an earlier run of this daemon held
};

// The daemon that decides.
struct Asker {
  std::string node;
  std::function<bool(const history::Member&)> is_alive;  // whether a member counts as there
  // Whether it keeps the robot of a lease in its name, or has let it go and not yet committed that; else the
  // lease is an earlier run's.
  std::function<bool(const history::Lease&)> keeps;
};

// Robots that the asker alone receives, or that no daemon does, stay where they are.
Assignment assign(const history::ClusterState& state, const Asker& asker);

// Of these nodes the one that keeps the robot; empty when there are none.
std::string keeper_of(std::string_view robot_id, const std::vector<std::string>& nodes);

struct ClusterOptions {
  std::string url;
  std::string name, node;
  std::string writer;                        // history::new_writer_name()
  std::chrono::milliseconds lifetime{5000};  // of a membership that is not renewed
};

struct ClusterStatus {
  std::string name, node;
  history::ClusterState state;                                  // as last read
  double read_s = std::numeric_limits<double>::quiet_NaN();     // ago; NaN: never
  double renewed_s = std::numeric_limits<double>::quiet_NaN();  // ago; NaN: never
  std::string error;                   // why the database was not reached last; empty: it was
  std::size_t kept = 0;                // robots
  std::uint64_t takeovers = 0;         // robots taken from daemons that were gone
  std::uint64_t handovers = 0;         // robots given to daemons that joined or hear them
  std::uint64_t dropped_commands = 0;  // for the robot's lease being another's
  std::uint64_t memberships_lost = 0;  // this daemon was away for longer than its lifetime
  std::uint64_t resumed_missions = 0;
  std::size_t held_messages = 0, held_bytes = 0;
  std::uint64_t held_dropped = 0;
};

// This daemon's part in a cluster: two threads with a connection each. One renews the membership and decides
// which robots this daemon keeps (assignment.h), several times a second; the other exchanges live state.
class Cluster {
 public:
  // Objects that the threads use; all are safe to use from any thread.
  struct Parts {
    const history::Store& store;
    ingest::Keeping& keeping;
    ingest::FleetView& fleet;
    ingest::ModelRegistry& models;
    ingest::Forecasts& forecasts;
    std::function<std::int64_t()> now_utime_us;
    std::function<void(const std::string& robot_id, const ingest::MissionRequest&)> request_mission;
    std::function<void(const std::string& text)> note;  // into the log
    // Is called with diagnoses that this daemon has to run in the place of one that is gone.
    std::function<void(std::int64_t diagnosis_id)> take_job;
  };

  Cluster(ClusterOptions options, Parts parts);
  ~Cluster();

  // Joins, and starts the threads. Fault::conflict on "cluster.node" or "cluster.name".
  Result<void> start(const std::string& address);
  // Call before this daemon ends: takes the robots of daemons that are gone, since no other daemon may have
  // their later messages, and then no more; 2 s at most. The membership is still renewed.
  void settle_down();
  // Ends the membership: other daemons take the released robots.
  void leave();

  ClusterStatus status() const;
  // True if this daemon does the work that exactly one daemon of the cluster has to do.
  bool is_first() const;
  // From any thread: so many commands were dropped because they have this epoch.
  void on_dropped(const std::string& robot_id, history::Epoch epoch, std::uint64_t count);

 private:
  using Clock = std::chrono::steady_clock;
  struct Release {
    history::Epoch epoch = 0;
    Clock::time_point since;
  };

  void keep(const std::stop_token& stop);
  void note(const Result<void>& done);
  Result<bool> turn();
  Result<void> renew();
  Result<void> publish_heard();
  Clock::duration steadily() const;
  bool is_alive(const history::Member& member) const;
  Result<bool> bury(const history::ClusterState& state);
  Result<std::size_t> reassign(const history::ClusterState& state);
  bool keeps(const history::Lease& lease);
  Result<void> take_jobs();
  void exchange(const std::stop_token& stop);

  const ClusterOptions options_;
  const Parts parts_;
  std::unique_ptr<history::Leases> leases_;

  mutable std::mutex mutex_;
  std::condition_variable settles_;
  bool settling_ = false, settled_ = false;
  ClusterStatus status_;
  std::optional<Clock::time_point> read_, renewed_, steady_since_;
  std::optional<Clock::time_point> reported_dropped_;

  // The keeper's own.
  std::set<std::string> said_heard_;
  std::map<std::int64_t, Clock::time_point> gone_since_;  // by incarnation
  Clock::time_point looked_for_jobs_{};
  std::map<std::string, Release> letting_go_;  // the last of each robot

  std::jthread keeper_, exchanger_;
};

}  // namespace joulecast::server
