#pragma once

#include "history/store.h"
#include "history/writer.h"
#include "ingest/counters.h"
#include "ingest/fleet_view.h"
#include "ingest/ingest_service.h"
#include "server/http/event_hub.h"
#include "server/metrics.h"

namespace joulecast::server {

// Exports the counters of the parts, refreshed at each scrape. The parts must outlive `metrics`.
void export_metrics(Metrics& metrics, const ingest::IngestCounters& counters,
                    const ingest::IngestService& ingest, const ingest::FleetView& fleet,
                    const history::Writer& writer, const history::Store& store, const http::EventHub& events,
                    std::function<std::int64_t()> now_utime_us);

// Exports the metrics of the store's standby.
void export_standby_metrics(Metrics& metrics, const history::Store& store);

}  // namespace joulecast::server
