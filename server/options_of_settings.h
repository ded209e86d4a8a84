#pragma once

#include <string>

#include "base/error.h"
#include "history/open_store.h"
#include "history/writer.h"
#include "ingest/ingest_service.h"
#include "server/cluster/cluster.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/diagnosis/drift_view.h"
#include "server/diagnosis/gap_watch.h"
#include "server/diagnosis/model_adoption.h"
#include "server/http/event_hub.h"
#include "server/http/http_server.h"
#include "server/mqtt/battery_topics.h"
#include "server/settings.h"
#include "server/webhooks/webhooks.h"

// The options of each part of the daemon, from the settings.
namespace joulecast {

std::string store_url(const Settings& settings);
// Fault::invalid on "store.read_url".
Result<history::StoreOptions> store_options(const Settings& settings);
// The spool, in the folder of the SQLite file; a local file also if the history is in a database server.
std::string spool_path(const Settings& settings);

// Fault::invalid on "cluster.name" or "cluster.node". An empty name: no cluster.
Result<server::ClusterOptions> cluster_options(const Settings& settings);

history::WriterOptions writer_options(const Settings& settings);
ingest::IngestOptions ingest_options(const Settings& settings);
server::AdoptionOptions adoption_options(const Settings& settings);
server::DiagnosisOptions diagnosis_options(const Settings& settings);
server::DriftOptions drift_options(const Settings& settings);
server::WatchOptions watch_options(const Settings& settings);
http::TlsFiles tls_files(const Settings& settings);
server::Webhooks::Options webhook_options(const Settings& settings);
// Fault::invalid on "mqtt.url", "mqtt.client_id", "mqtt.interface", "mqtt.manufacturer" or
// "mqtt.password_file".
Result<server::BatteryTopics::Options> mqtt_options(const Settings& settings);
http::ServerOptions http_options(const Settings& settings);
http::EventHub::Options event_options(const Settings& settings);

}  // namespace joulecast
