#pragma once

#include <chrono>
#include <string>
#include <vector>

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
#include "server/logging.h"
#include "server/mqtt/battery_topics.h"
#include "server/webhooks/webhooks.h"

namespace joulecast {

// The options of the parts of the daemon. settings_table.cc binds a setting to each of its members; their
// values here are the defaults of the settings.
struct DaemonOptions {
  DaemonOptions();

  http::ServerOptions http;
  http::EventHub::Options events;
  bool insecure = false;
  std::string token_file, web_directory;
  std::chrono::milliseconds stop_deadline{5000};

  std::string webhooks_file;
  server::Webhooks::Options webhooks;

  std::string mqtt_url, mqtt_password_file;
  server::BatteryTopics::Options mqtt;

  std::string store_path = "joulecast.db", store_url;
  history::StoreOptions store;
  history::WriterOptions writer;

  server::ClusterOptions cluster;
  ingest::IngestOptions ingest;

  std::string robots_directory;
  server::AdoptionOptions adoption;
  bool adopts_automatically = false;
  server::DiagnosisOptions diagnosis;
  server::DriftOptions drift;
  server::WatchOptions watch;

  double price_per_kwh = 0, co2_g_per_kwh = 0;  // 0: not stated
  std::string currency = "EUR";

  std::uint64_t robots_with_metrics = 200;
  LogFormat log_format = LogFormat::text;
  LogLevel log_level = LogLevel::info;
};

// store.url, or that of the file store.path.
std::string store_url(const DaemonOptions& options);
// The spool, in the folder of the SQLite file; a local file also if the history is in a database server.
std::string spool_path(const DaemonOptions& options);

// The options of parts whose settings depend on each other. Fault::invalid on "cluster.name" or
// "cluster.node". An empty name: no cluster.
Result<server::ClusterOptions> cluster_options(const DaemonOptions& options);
// Fault::invalid on "mqtt.url", "mqtt.client_id", "mqtt.interface", "mqtt.manufacturer",
// "mqtt.password_file" or "mqtt.authorities".
Result<server::BatteryTopics::Options> mqtt_options(const DaemonOptions& options);

// All errors in the values of the settings that can be detected without opening the store or connecting to a
// broker, with those of the files that they name.
std::vector<Error> faults_of(const DaemonOptions& options);

// Without tokens only loopback addresses are permitted, unless http.insecure is set. Fault::invalid on
// "http.address", "http.allowed_origins" or "http.allowed_hosts"; permitted unsafe settings are logged.
Result<void> check_exposure(const DaemonOptions& options);

}  // namespace joulecast
