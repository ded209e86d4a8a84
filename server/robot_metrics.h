#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "ingest/fleet_view.h"
#include "server/diagnosis/gap_watch.h"
#include "server/metrics.h"

namespace joulecast::server {

// Metrics of each robot, of `most_robots` at most, the first by id; joulecast_robots_without_metrics counts
// the others. Joules count missions since the daemon started. Terms of the ledger may fall, as kinetic energy
// does, and are gauges; drawn and returned energy are counters. The parts must outlive `metrics`.
void export_robot_metrics(Metrics& metrics, const ingest::FleetView& fleet, const GapWatch& watch,
                          std::function<std::int64_t()> now_utime_us, std::size_t most_robots);

}  // namespace joulecast::server
