#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "history/leases.h"

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

}  // namespace joulecast::server
