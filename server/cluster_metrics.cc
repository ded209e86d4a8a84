#include "server/cluster_metrics.h"

#include <algorithm>

namespace joulecast::server {

void export_cluster_metrics(Metrics& metrics, const Cluster& cluster) {
  using S = ClusterStatus;
  metrics.rows<S>(
      [&cluster] { return cluster.status(); },
      {{"joulecast_cluster_members", "Daemons of the cluster that renew their memberships",
        [](const S& s) {
          return static_cast<double>(
              std::ranges::count_if(s.state.members, [](const auto& m) { return m.expires_in_s > 0; }));
        }},
       {"joulecast_cluster_robots_kept", "Robots that this daemon keeps", &S::kept},
       {"joulecast_cluster_robots_free", "Robots that no daemon keeps for now",
        [](const S& s) {
          return static_cast<double>(std::ranges::count_if(s.state.leases, [&](const history::Lease& lease) {
            return std::ranges::find(s.state.members, lease.node, &history::Member::node) ==
                   s.state.members.end();
          }));
        }},
       {"joulecast_cluster_renewed_age_seconds", "Time since this daemon last renewed its membership",
        &S::renewed_s},
       {"joulecast_cluster_held_messages", "Messages held of robots that other daemons keep, for a takeover",
        &S::held_messages},
       {"joulecast_cluster_held_bytes", "Memory that these hold", &S::held_bytes},
       {"joulecast_cluster_held_messages_dropped_total", "Held messages discarded from a full queue",
        &S::held_dropped},
       {"joulecast_cluster_takeovers_total", "Robots that this daemon took over from failed daemons",
        &S::takeovers},
       {"joulecast_cluster_handovers_total",
        "Robots that this daemon handed to another that joined or receives them", &S::handovers},
       {"joulecast_cluster_missions_resumed_total", "Open missions that this daemon took over",
        &S::resumed_missions},
       {"joulecast_cluster_commands_dropped_total",
        "Commands of this daemon that were not stored: another one keeps the robot now",
        &S::dropped_commands},
       {"joulecast_cluster_memberships_lost_total",
        "Times that this daemon was away for longer than cluster.lease_s", &S::memberships_lost}});
}

}  // namespace joulecast::server
