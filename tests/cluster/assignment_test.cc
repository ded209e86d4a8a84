#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "server/cluster/cluster.h"

namespace joulecast::server {
namespace {

using history::ClusterState;
using history::Lease;

const auto everybody = [](const history::Member&) { return true; };
const auto all_kept = [](const Lease&) { return true; };

ClusterState state_of(const std::vector<std::string>& nodes, int robots, double heard_s = 60) {
  ClusterState state;
  for (const std::string& node : nodes) {
    history::Member& member = state.members.emplace_back();
    member.node = node;
    for (int k = 0; k < robots; ++k) state.hearings.push_back({node, "robot-" + std::to_string(k), heard_s});
  }
  return state;
}

Lease lease(const std::string& robot_id, const std::string& node, double taken_s = 60) {
  Lease made;
  made.robot_id = robot_id;
  made.node = node;
  made.epoch = 1;
  made.taken_s = taken_s;
  return made;
}

// Node by robot, from the robots that each node takes.
std::map<std::string, std::string> taken_by_all(const ClusterState& state) {
  std::map<std::string, std::string> keepers;
  for (const history::Member& member : state.members)
    for (const Lease& each : assign(state, {member.node, everybody, all_kept}).take)
      EXPECT_TRUE(keepers.emplace(each.robot_id, member.node).second) << each.robot_id << " is taken twice";
  return keepers;
}

ClusterState kept_as(ClusterState state, const std::map<std::string, std::string>& keepers) {
  for (const auto& [robot_id, node] : keepers) state.leases.push_back(lease(robot_id, node));
  return state;
}

TEST(Assignment, EachRobotHasOneDaemon) {
  const auto keepers = taken_by_all(state_of({"a", "b", "c"}, 300));
  EXPECT_EQ(keepers.size(), 300u);
  std::map<std::string, int> count;
  for (const auto& [robot_id, node] : keepers) ++count[node];
  for (const auto& [node, robots] : count) EXPECT_NEAR(robots, 100, 35) << node;
}

TEST(Assignment, JoiningDaemonTakesItsShare) {
  const auto before = taken_by_all(state_of({"a", "b", "c"}, 300));
  const ClusterState joined = kept_as(state_of({"a", "b", "c", "d"}, 300), before);
  std::size_t moved = 0;
  for (const std::string node : {"a", "b", "c", "d"}) {
    const Assignment decided = assign(joined, {node, everybody, all_kept});
    EXPECT_TRUE(decided.take.empty());
    for (const Lease& each : decided.hand_over)
      EXPECT_EQ(keeper_of(each.robot_id, {"a", "b", "c", "d"}), "d");
    moved += decided.hand_over.size();
  }
  EXPECT_NEAR(static_cast<double>(moved), 75, 30);
}

TEST(Assignment, MovesOnlyOrphanedRobots) {
  const auto before = taken_by_all(state_of({"a", "b", "c"}, 300));
  const ClusterState left = kept_as(state_of({"a", "b"}, 300), before);
  std::set<std::string> moved;
  for (const std::string node : {"a", "b"}) {
    const Assignment decided = assign(left, {node, everybody, all_kept});
    EXPECT_TRUE(decided.hand_over.empty());
    for (const Lease& each : decided.take) moved.insert(each.robot_id);
  }
  for (const auto& [robot_id, node] : before) EXPECT_EQ(moved.contains(robot_id), node == "c") << robot_id;
}

TEST(Assignment, RequiresRecentlyHeardRobots) {
  const auto before = taken_by_all(state_of({"a"}, 50));
  ClusterState state = kept_as(state_of({"a", "b"}, 50), before);
  for (history::Hearing& each : state.hearings)
    if (each.node == "b") each.since_s = settled_s / 2;
  EXPECT_TRUE(assign(state, {"a", everybody, all_kept}).hand_over.empty());
}

TEST(Assignment, LongestListenerTakesFreeRobot) {
  ClusterState state = state_of({"a", "b", "c"}, 50);
  for (history::Hearing& each : state.hearings)
    each.since_s = each.node == "b" ? settled_s / 2 : settled_s / 4;
  for (const auto& [robot_id, node] : taken_by_all(state)) EXPECT_EQ(node, "b") << robot_id;
  EXPECT_EQ(taken_by_all(state).size(), 50u);
}

TEST(Assignment, OnlyListenerKeepsRobot) {
  ClusterState state = state_of({"a", "b"}, 0);
  for (const std::string robot : {"x", "y", "z", "w"}) {
    state.hearings.push_back({"b", robot, 60});
    state.leases.push_back(lease(robot, "a"));
  }
  EXPECT_EQ(assign(state, {"a", everybody, all_kept}).hand_over.size(), 4u);
  for (Lease& each : state.leases) each.node = "";
  EXPECT_TRUE(assign(state, {"a", everybody, all_kept}).take.empty());
  EXPECT_EQ(assign(state, {"b", everybody, all_kept}).take.size(), 4u);
}

TEST(Assignment, KeepsUnheardRobots) {
  ClusterState state = state_of({"a", "b"}, 0);
  state.leases = {lease("kept", "a"), lease("orphan", "gone"), lease("free", "")};
  std::size_t taken = 0;
  for (const std::string node : {"a", "b"}) {
    const Assignment decided = assign(state, {node, everybody, all_kept});
    EXPECT_TRUE(decided.hand_over.empty());
    taken += decided.take.size();
  }
  EXPECT_EQ(taken, 2u);
}

TEST(Assignment, ReclaimsOrFreesEarlierLeases) {
  ClusterState state = state_of({"a", "b"}, 100);
  for (int k = 0; k < 100; ++k) state.leases.push_back(lease("robot-" + std::to_string(k), "a"));
  const Assignment decided = assign(state, {"a", everybody, [](const Lease&) { return false; }});
  EXPECT_EQ(decided.take.size() + decided.free.size(), 100u);
  for (const Lease& each : decided.take) EXPECT_EQ(keeper_of(each.robot_id, {"a", "b"}), "a");
  for (const Lease& each : decided.free) EXPECT_EQ(keeper_of(each.robot_id, {"a", "b"}), "b");
}

TEST(Assignment, DeadDaemonGetsNothing) {
  const auto decided =
      assign(state_of({"a", "b"}, 100), {"a", [](const auto& m) { return m.node == "a"; }, all_kept});
  EXPECT_EQ(decided.take.size(), 100u);
}

}  // namespace
}  // namespace joulecast::server
