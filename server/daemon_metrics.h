#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>

#include "history/store.h"
#include "history/writer.h"
#include "ingest/counters.h"
#include "ingest/fleet_view.h"
#include "ingest/ingest_service.h"
#include "server/api/attention.h"
#include "server/cluster/cluster.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/diagnosis/gap_watch.h"
#include "server/diagnosis/model_adoption.h"
#include "server/http/event_hub.h"
#include "server/metrics.h"
#include "server/mqtt/battery_topics.h"
#include "server/webhooks/webhooks.h"

namespace joulecast::server {

// The store's sizes, read on a thread of their own: reading may take as long as a lock in the database.
class StoreSizes {
 public:
  explicit StoreSizes(const history::Store& store) : store_(store) {}
  // Begins to read them unless they are still being read. Those that were read within 100 ms, else those
  // before, at first zeros. One thread at a time.
  history::StoreSize read();

 private:
  const history::Store& store_;
  std::future<Result<history::StoreSize>> reading_;
  history::StoreSize last_;
};

// Exports the counters of the parts, refreshed at each scrape. The parts must outlive `metrics`.
void export_metrics(Metrics& metrics, const ingest::IngestCounters& counters,
                    const ingest::IngestService& ingest, const ingest::FleetView& fleet,
                    const history::Writer& writer, StoreSizes& sizes, const http::EventHub& events,
                    std::function<std::int64_t()> now_utime_us);

// joulecast_cluster_*: this daemon's part in its cluster.
void export_cluster_metrics(Metrics& metrics, const Cluster& cluster);

// Exports the counters of diagnoses, the watch of the gap and adoptions, refreshed at each scrape.
void export_gap_metrics(Metrics& metrics, const DiagnosisService& diagnoses, const GapWatch& watch,
                        const ModelAdoption& adoption);

// Exports the number of entries of the attention list that are not acknowledged, by severity.
void export_attention_metrics(Metrics& metrics, const api::AttentionList& list);

// joulecast_mqtt_*. Both must outlive the metrics.
void export_mqtt_metrics(Metrics& metrics, const BatteryTopics& topics);

// The metrics process_*, Prometheus's convention for all programs, and joulecast_build_info.
void export_process_metrics(Metrics& metrics);

// Metrics of each robot, of `most_robots` at most, the first by id; joulecast_robots_without_metrics counts
// the others. Joules count missions since the daemon started. Terms of the ledger may fall, as kinetic energy
// does, and are gauges; drawn and returned energy are counters. The parts must outlive `metrics`.
void export_robot_metrics(Metrics& metrics, const ingest::FleetView& fleet, const GapWatch& watch,
                          std::function<std::int64_t()> now_utime_us, std::size_t most_robots);

// joulecast_webhook_*: of each webhook, by its number in the file and its host. Both outlive the metrics.
void export_webhook_metrics(Metrics& metrics, const Webhooks& webhooks);

}  // namespace joulecast::server
