#pragma once

#include <cstddef>
#include <cstdint>
#include <future>
#include <vector>

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

// The metrics of the parts at a scrape.
using AllSeries = std::vector<Metrics::Series>;
AllSeries message_series(const ingest::IngestCounters& counters, const ingest::IngestService& ingest);
AllSeries mission_series(const ingest::IngestCounters& counters);
AllSeries fleet_series(const ingest::FleetView& fleet, std::int64_t now_utime_us);
AllSeries writer_series(const history::Writer& writer);
AllSeries store_series(const history::StoreSize& size);
AllSeries stream_series(const http::EventHub& events);
AllSeries gap_series(const DiagnosisService& diagnoses, const GapWatch& watch, const ModelAdoption& adoption);
// The entries of the attention list that are not acknowledged, by severity.
AllSeries attention_series(const api::AttentionList& list);
// This daemon's part in its cluster.
AllSeries cluster_series(const Cluster& cluster);
AllSeries mqtt_series(const BatteryTopics& topics);
// Of each webhook, by its number in the file and its host.
AllSeries webhook_series(const Webhooks& webhooks);

// The metrics process_*, Prometheus's convention for all programs, and joulecast_build_info.
AllSeries process_series();

// Metrics of each robot, of `most_robots` at most, the first by id; joulecast_robots_without_metrics counts
// the others. Joules count missions since the daemon started. Terms of the ledger may fall, as kinetic energy
// does, and are gauges; drawn and returned energy are counters.
AllSeries robot_series(const ingest::FleetView& fleet, const GapWatch& watch, std::int64_t now_utime_us,
                       std::size_t most_robots);

}  // namespace joulecast::server
