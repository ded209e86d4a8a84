#pragma once

#include "server/metrics.h"

namespace joulecast::server {

// What Prometheus expects of every program (process_*), and joulecast_build_info.
void export_process_metrics(Metrics& metrics);

}  // namespace joulecast::server
