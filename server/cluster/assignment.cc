#include "server/cluster/assignment.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "base/text.h"

namespace joulecast::server {
namespace {

// FNV-1a of both names, mixed by the finalizer of MurmurHash3: the same in every build and on every machine.
std::uint64_t weight(std::string_view node, std::string_view robot_id) {
  constexpr std::string_view end = "\xff";
  std::uint64_t hash = fnv1a(end, fnv1a(robot_id, fnv1a(end, fnv1a(node))));
  hash = (hash ^ hash >> 33) * 0xff51afd7ed558ccdULL;
  hash = (hash ^ hash >> 33) * 0xc4ceb9fe1a85ec53ULL;
  return hash ^ hash >> 33;
}

struct Hearers {
  std::vector<std::string> settled, longest;
  double longest_s = -1;

  void add(const history::Hearing& each) {
    if (each.since_s >= settled_s) settled.push_back(each.node);
    if (each.since_s > longest_s) longest.clear();
    if (each.since_s >= longest_s) longest.push_back(each.node), longest_s = each.since_s;
  }
};

}  // namespace

std::string keeper_of(std::string_view robot_id, const std::vector<std::string>& nodes) {
  const auto most = std::ranges::max_element(nodes, {}, [&](const std::string& node) {
    return std::pair(weight(node, robot_id), std::string_view(node));
  });
  return most == nodes.end() ? std::string() : *most;
}

Assignment assign(const history::ClusterState& state, const Asker& asker) {
  std::vector<std::string> alive;
  std::set<std::string, std::less<>> members;
  for (const history::Member& member : state.members) {
    members.insert(member.node);
    if (asker.is_alive(member)) alive.push_back(member.node);
  }
  std::map<std::string, Hearers, std::less<>> hearers;
  for (const history::Hearing& each : state.hearings)
    if (std::ranges::find(alive, each.node) != alive.end()) hearers[each.robot_id].add(each);
  std::map<std::string, history::Lease, std::less<>> leases;
  for (const history::Lease& lease : state.leases) leases.emplace(lease.robot_id, lease);
  for (const auto& [robot_id, of_robot] : hearers) {
    history::Lease none;
    none.robot_id = robot_id;
    leases.try_emplace(robot_id, std::move(none));
  }

  Assignment decided;
  for (const auto& [robot_id, lease] : leases) {
    const auto found = hearers.find(robot_id);
    const Hearers of_robot = found == hearers.end() ? Hearers{} : found->second;
    const bool own = lease.node == asker.node, left_over = own && !asker.keeps(lease);
    if (left_over || lease.node.empty() || !members.contains(lease.node)) {
      // An open mission must be ended even when its robot sends no more messages.
      const auto& candidates = !of_robot.settled.empty()   ? of_robot.settled
                               : !of_robot.longest.empty() ? of_robot.longest
                                                           : alive;
      if (keeper_of(robot_id, candidates) == asker.node)
        decided.take.push_back(lease);
      else if (left_over)
        decided.free.push_back(lease);
    } else if (own && lease.taken_s >= settled_s) {
      const std::string keeper = keeper_of(robot_id, of_robot.settled);
      if (!keeper.empty() && keeper != asker.node) decided.hand_over.push_back(lease);
    }
  }
  return decided;
}

}  // namespace joulecast::server
