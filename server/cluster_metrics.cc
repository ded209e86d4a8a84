#include "server/cluster_metrics.h"

#include <algorithm>

namespace joulecast::server {

void export_cluster_metrics(Metrics& metrics, const Cluster& cluster) {
  const Gauge members =
      metrics.gauge("joulecast_cluster_members", "Daemons of the cluster that renew their memberships");
  const Gauge kept = metrics.gauge("joulecast_cluster_robots_kept", "Robots that this daemon keeps");
  const Gauge free = metrics.gauge("joulecast_cluster_robots_free", "Robots that no daemon keeps for now");
  const Gauge renewed = metrics.gauge("joulecast_cluster_renewed_age_seconds",
                                      "Time since this daemon last renewed its membership");
  const Gauge held = metrics.gauge("joulecast_cluster_held_messages",
                                   "Messages held of robots that other daemons keep, for a takeover");
  const Gauge held_bytes = metrics.gauge("joulecast_cluster_held_bytes", "Memory that these hold");
  const Counter held_dropped = metrics.counter("joulecast_cluster_held_messages_dropped_total",
                                               "Held messages discarded from a full queue");
  const Counter takeovers = metrics.counter("joulecast_cluster_takeovers_total",
                                            "Robots that this daemon took from daemons that were gone");
  const Counter handovers =
      metrics.counter("joulecast_cluster_handovers_total",
                      "Robots that this daemon handed to another that joined or hears them");
  const Counter resumed =
      metrics.counter("joulecast_cluster_missions_resumed_total", "Open missions that this daemon took over");
  const Counter dropped =
      metrics.counter("joulecast_cluster_commands_dropped_total",
                      "Commands of this daemon that were not stored: another one keeps the robot since");
  const Counter lost = metrics.counter("joulecast_cluster_memberships_lost_total",
                                       "Times that this daemon was away for longer than cluster.lease_s");
  metrics.before_scrape([=, &cluster] {
    const ClusterStatus now = cluster.status();
    members.set(static_cast<double>(
        std::ranges::count_if(now.state.members, [](const auto& m) { return m.expires_in_s > 0; })));
    kept.set(static_cast<double>(now.kept));
    free.set(static_cast<double>(std::ranges::count_if(now.state.leases, [&](const history::Lease& lease) {
      return std::ranges::find(now.state.members, lease.node, &history::Member::node) ==
             now.state.members.end();
    })));
    renewed.set(now.renewed_s);
    held.set(static_cast<double>(now.held_messages));
    held_bytes.set(static_cast<double>(now.held_bytes));
    held_dropped.raise_to(static_cast<double>(now.held_dropped));
    takeovers.raise_to(static_cast<double>(now.takeovers));
    handovers.raise_to(static_cast<double>(now.handovers));
    resumed.raise_to(static_cast<double>(now.resumed_missions));
    dropped.raise_to(static_cast<double>(now.dropped_commands));
    lost.raise_to(static_cast<double>(now.memberships_lost));
  });
}

}  // namespace joulecast::server
