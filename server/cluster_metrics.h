#pragma once

#include "server/cluster/cluster.h"
#include "server/metrics.h"

namespace joulecast::server {

// joulecast_cluster_*: this daemon's part in its cluster.
void export_cluster_metrics(Metrics& metrics, const Cluster& cluster);

}  // namespace joulecast::server
