#pragma once

#include "history/store.h"
#include "history/writer.h"
#include "server/http/event_hub.h"
#include "server/ingest/counters.h"
#include "server/ingest/fleet_view.h"
#include "server/ingest/ingest_service.h"
#include "server/metrics.h"

namespace joulecast::server {

// What the parts count, as metrics refreshed at each scrape. The parts must outlive `metrics`.
void export_metrics(Metrics& metrics, const IngestCounters& counters, const IngestService& ingest,
                    const FleetView& fleet, const history::Writer& writer, const history::Store& store,
                    const http::EventHub& events, std::function<std::int64_t()> now_utime_us);

}  // namespace joulecast::server
