#include <algorithm>

#include "server/api/services.h"

// The cluster that this daemon is a member of, as it last read it from the database.
namespace joulecast::api {
namespace {

// A daemon of the cluster, with the robots that it keeps and receives.
struct Node : history::Member {
  std::size_t kept = 0, heard = 0;
};

struct HeldLease : history::Lease {
  bool is_held = false;  // by a daemon of the cluster
};

struct ClusterAnswer : server::ClusterStatus {
  std::vector<Node> nodes;
  std::vector<HeldLease> leases;
};

const Schema counted{{"minimum", 0}};

const auto own_table =
    Table<server::ClusterStatus>()
        .value("robots_kept", AT(kept), "by this daemon", counted)
        .value("takeovers", AT(takeovers), "robots taken over from failed daemons, since the start", counted)
        .value("handovers", AT(handovers), "robots handed to daemons that joined or receive their telemetry",
               counted)
        .value("missions_resumed", AT(resumed_missions), "open missions taken over", counted)
        .value("commands_dropped", AT(dropped_commands),
               "commands that were not stored because another daemon keeps the robot", counted)
        .value("memberships_lost", AT(memberships_lost), "number of absences longer than cluster.lease_s",
               counted)
        .value("held_messages", AT(held_messages),
               "messages held for a possible takeover of robots that other daemons keep", counted)
        .value("held_messages_dropped", AT(held_dropped), "held messages dropped from a full queue", counted);

const auto node_table =
    Table<Node>()
        .value("node", AT(node), "cluster.node")
        .value("address", AT(address), "its address")
        .value("version", AT(version), "of the program")
        .value(
            "alive", [](const Node& n) { return n.expires_in_s > 0 && n.connected; },
            "true while it renews its membership and its connection is open")
        .value("joined_s", AT(joined_s), "time since it joined, s", counted)
        .value("lease_left_s", AT(expires_in_s),
               "time until other daemons take over its robots unless it renews the lease, s")
        .value("robots_kept", AT(kept), "leases in its name", counted)
        .value("robots_heard", AT(heard), "robots from which it receives telemetry", counted);
const auto lease_table =
    Table<HeldLease>()
        .value("robot_id", AT(robot_id), "robot of the lease")
        .value(
            "node", [](const HeldLease& l) { return l.is_held ? std::optional(l.node) : std::nullopt; },
            "node that has the lease; null: none at present")
        .value("epoch", AT(epoch), "increases with every change of the node", counted)
        .value("taken_s", AT(taken_s), "time since the node took it, s", counted)
        .value("takeovers", AT(takeovers), "number of takeovers from failed daemons", counted)
        .time(
            "stored",
            [](const HeldLease& l) {
              return l.position ? std::optional(l.position->utime_us) : std::nullopt;
            },
            "robot's time of the last stored sample of a mission, µs since the Unix epoch")
        .value(
            "stored_sequence",
            [](const HeldLease& l) {
              return l.position ? std::optional(l.position->sequence) : std::nullopt;
            },
            "its sequence number", counted);
const auto cluster_table =
    Table<ClusterAnswer>("Cluster")
        .text_or_null("name", AT(name), "cluster.name; null: this daemon is in no cluster")
        .text_or_null("node", AT(node), "the responding daemon; null: in no cluster")
        .number_or_null("read_s", AT(read_s),
                        "time since these data were read from the database, s; null: never", counted)
        .number_or_null("renewed_s", AT(renewed_s), "time since it renewed its membership, s; null: never",
                        counted)
        .text_or_null("error", AT(error), "error of the connection to the database; null: none")
        .list("nodes", AT(nodes), "the daemons of the cluster, this one among them", node_table)
        .list("leases", AT(leases), "leases of all robots that were ever kept", lease_table)
        .object("own", std::identity(), "counters of the responding daemon", own_table);

Result<Response> cluster(const Services& services, const Request&) {
  // A daemon outside a cluster returns the same object with a null name.
  ClusterAnswer answer;
  if (services.cluster != nullptr) static_cast<server::ClusterStatus&>(answer) = services.cluster->status();
  const history::ClusterState& state = answer.state;
  for (const history::Member& member : state.members)
    answer.nodes.push_back(
        {member,
         static_cast<std::size_t>(std::ranges::count(state.leases, member.node, &history::Lease::node)),
         static_cast<std::size_t>(std::ranges::count(state.hearings, member.node, &history::Hearing::node))});
  for (const history::Lease& lease : state.leases)
    answer.leases.push_back(
        {lease, std::ranges::find(state.members, lease.node, &history::Member::node) != state.members.end()});
  return http::json_response(cluster_table.text(answer));
}

}  // namespace

Part cluster_part() {
  Part part;
  part.add(Method::get, "/v1/cluster", "getCluster", Role::read,
           "The daemons that share the fleet, and which of them keeps which robot; name is null where "
           "cluster.name is not set",
           {"cluster", cluster_table.schema()}, cluster);
  return part;
}

}  // namespace joulecast::api
