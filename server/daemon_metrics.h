#pragma once

#include <future>
#include <optional>

#include "history/store.h"
#include "history/writer.h"
#include "ingest/counters.h"
#include "ingest/fleet_view.h"
#include "ingest/ingest_service.h"
#include "server/http/event_hub.h"
#include "server/metrics.h"

namespace joulecast::server {

// The store's sizes, read on a thread of their own: reading may take as long as a lock in the database.
class StoreSizes {
 public:
  explicit StoreSizes(const history::Store& store) : store_(store) {}
  // Begins to read them unless they are still being read; those that were read within 100 ms, else nothing.
  // One thread at a time.
  std::optional<history::StoreSize> read();

 private:
  const history::Store& store_;
  std::future<Result<history::StoreSize>> reading_;
};

// Exports the counters of the parts, refreshed at each scrape. The parts must outlive `metrics`.
void export_metrics(Metrics& metrics, const ingest::IngestCounters& counters,
                    const ingest::IngestService& ingest, const ingest::FleetView& fleet,
                    const history::Writer& writer, StoreSizes& sizes, const http::EventHub& events,
                    std::function<std::int64_t()> now_utime_us);

// Exports the metrics of the store's standby.
void export_standby_metrics(Metrics& metrics, const history::Store& store);

}  // namespace joulecast::server
