#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "history/leases.h"

namespace joulecast::server {

// How long a daemon must have received a robot before it is handed the robot by one that is alive: what it
// holds of the robot's messages must reach back to before the other one's last commit. Where no daemon has
// received a robot that nobody keeps for so long, the one that has for longest takes it.
inline constexpr double settled_s = 3;

// What one daemon does about the cluster's robots, from the state that all of them read. Rendezvous hashing:
// of the daemons that receive a robot, the one with the greatest hash of its own and the robot's name keeps
// it; so a daemon that joins or leaves moves its own share of the robots and no other.
struct Assignment {
  std::vector<history::Lease> take;       // that nobody holds
  std::vector<history::Lease> hand_over;  // that this daemon holds
  std::vector<history::Lease> free;       // that an earlier run of this daemon held
};

// Who is asked.
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
