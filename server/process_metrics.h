#pragma once

#include "server/metrics.h"

namespace joulecast::server {

// The metrics process_*, Prometheus's convention for all programs, and joulecast_build_info.
void export_process_metrics(Metrics& metrics);

}  // namespace joulecast::server
