#include "server/options_of_settings.h"

#include <unistd.h>

#include <array>
#include <chrono>
#include <sstream>
#include <utility>

#include "access/secret_file.h"
#include "base/host_clock.h"
#include "history/open_store.h"
#include "history/postgres_store.h"
#include "server/logging.h"

namespace joulecast {
namespace {

using std::chrono::milliseconds;

constexpr double seconds_per_day = 86400;

milliseconds seconds(double s) {
  return milliseconds(static_cast<std::int64_t>(s * 1000));
}
std::int64_t microseconds(double s) {
  return static_cast<std::int64_t>(s * 1e6);
}

// The entries of a list separated by commas.
std::vector<std::string> listed(const std::string& text) {
  std::vector<std::string> entries;
  std::istringstream rest(text);
  for (std::string entry; std::getline(rest, entry, ',');)
    if (!entry.empty()) entries.push_back(entry);
  return entries;
}

}  // namespace

std::string store_url(const Settings& settings) {
  const std::string& url = settings.text("store.url");
  return url.empty() ? "sqlite:" + settings.text("store.path") : url;
}

Result<history::StoreOptions> store_options(const Settings& settings) {
  history::StoreOptions options;
  if (settings.text("store.synchronous") == "normal") options.durability = history::Durability::process_end;
  options.query_limit = seconds(settings.number("http.request_deadline_s"));
  options.standby.url = settings.text("store.read_url");
  options.standby.max_staleness_s = settings.number("store.read_staleness_s");
  if (options.standby.url.empty()) return options;
  if (!history::is_postgres_url(options.standby.url) || !history::is_postgres_url(store_url(settings)))
    return invalid("store.read_url", "must be the postgresql://... of a standby of the server of store.url");
  if (Result<void> sound = history::check_store_url(options.standby.url); !sound)
    return invalid("store.read_url", sound.error().message);
  return options;
}

// In the folder of the SQLite file; a local file also if the history is in a database server.
std::string spool_path(const Settings& settings) {
  const std::string url = store_url(settings);
  return (history::is_postgres_url(url) ? settings.text("store.path") : history::sqlite_path(url)) + ".spool";
}

Result<server::ClusterOptions> cluster_options(const Settings& settings) {
  constexpr std::size_t longest_name = 64;
  server::ClusterOptions options;
  options.name = settings.text("cluster.name");
  options.node = settings.text("cluster.node");
  if (options.name.empty()) {
    if (!options.node.empty())
      return invalid("cluster.node", "names a daemon of a cluster, and no cluster.name is set");
    return options;
  }
  options.url = store_url(settings);
  if (!history::is_postgres_url(options.url))
    return invalid("cluster.name",
                   "daemons share a fleet through a PostgreSQL: set store.url to postgresql://...");
  if (options.node.empty()) {
    std::array<char, 256> host{};
    if (gethostname(host.data(), host.size() - 1) == 0) options.node = host.data();
  }
  for (const auto& [key, text] : {std::pair("cluster.name", options.name), {"cluster.node", options.node}}) {
    if (text.empty() || text.size() > longest_name)
      return invalid(key, "must have 1 to " + std::to_string(longest_name) + " bytes");
  }
  options.writer = history::new_writer_name();
  options.lifetime = seconds(settings.number("cluster.lease_s"));
  return options;
}

history::WriterOptions writer_options(const Settings& settings) {
  history::WriterOptions options;
  if (const double days = settings.number("store.retention_days"); days > 0) {
    options.retention.telemetry_max_age_us = microseconds(days * seconds_per_day);
  }
  if (const auto bytes = settings.integer("store.retention_bytes"); bytes > 0)
    options.retention.telemetry_max_bytes = bytes;
  if (const double days = settings.number("store.retention_missions_days"); days > 0)
    options.missions_max_age_us = microseconds(days * seconds_per_day);
  if (const auto events = settings.integer("store.retention_events"); events > 0)
    options.events_kept = events;
  if (const double days = settings.number("store.retention_audit_days"); days > 0)
    options.audit_max_age_us = microseconds(days * seconds_per_day);
  options.queue_bytes = static_cast<std::size_t>(settings.integer("store.queue_bytes"));
  options.spool_path = spool_path(settings);
  options.on_error = [](const Error& error) { log_error("store", error); };
  options.on_recovery = [] { log_info("store: commits succeed again"); };
  return options;
}

ingest::IngestOptions ingest_options(const Settings& settings) {
  ingest::IngestOptions options;
  options.lcm_url = settings.text("lcm.url");
  options.listen = {settings.text("lcm.bind_address"), settings.text("lcm.accept_from")};
  options.queue_messages = static_cast<std::size_t>(settings.integer("ingest.queue_messages"));
  options.energy_state_period = seconds(settings.number("energy_state.period_s"));
  options.max_unknown_robots = static_cast<std::size_t>(settings.integer("ingest.max_unknown_robots"));
  options.signatures = {settings.text("ingest.key_file"), settings.boolean("ingest.require_signed"),
                        microseconds(settings.number("ingest.signature_age_s"))};
  options.session.meter.tolerance = settings.number("meter.tolerance");
  options.session.meter.gap_bridge_s = settings.number("ingest.gap_bridge_s");
  options.session.mission.explicit_silence_us =
      microseconds(settings.number("ingest.mission_idle_timeout_s"));
  options.session.implicit_missions = settings.boolean("ingest.implicit_missions");
  options.session.reorder_us = microseconds(settings.number("ingest.reorder_s"));
  options.session.sender_takeover_us = microseconds(settings.number("ingest.sender_takeover_s"));
  options.session.max_ahead_us = microseconds(settings.number("ingest.max_clock_ahead_s"));
  options.session.booked_margin_us = microseconds(settings.number("ingest.booked_time_margin_s"));
  options.session.event_rate_hz = settings.number("ingest.event_rate_hz");
  return options;
}

server::AdoptionOptions adoption_options(const Settings& settings) {
  server::AdoptionOptions options;
  options.most_robots = static_cast<std::size_t>(settings.integer("robots.most"));
  options.max_missions = static_cast<std::size_t>(settings.integer("adoption.max_missions"));
  options.max_samples = static_cast<std::size_t>(settings.integer("adoption.max_samples"));
  options.meter.tolerance = settings.number("meter.tolerance");
  options.meter.gap_bridge_s = settings.number("ingest.gap_bridge_s");
  return options;
}

server::DiagnosisOptions diagnosis_options(const Settings& settings) {
  server::DiagnosisOptions options;
  options.queue = static_cast<std::size_t>(settings.integer("diagnosis.queue"));
  options.max_missions = static_cast<std::size_t>(settings.integer("diagnosis.max_missions"));
  options.max_samples = static_cast<std::size_t>(settings.integer("diagnosis.max_samples"));
  options.max_memory_bytes = static_cast<std::uint64_t>(settings.integer("diagnosis.max_memory_bytes"));
  options.deadline = seconds(settings.number("diagnosis.deadline_s"));
  return options;
}

server::DriftOptions drift_options(const Settings& settings) {
  server::DriftOptions options;
  options.settings.least_change = settings.number("watch.least_change");
  return options;
}

server::WatchOptions watch_options(const Settings& settings) {
  server::WatchOptions options;
  options.period_s = settings.number("watch.period_s");
  options.diagnose = settings.boolean("watch.diagnose");
  for (std::string& id : listed(settings.text("watch.robots"))) options.robots.insert(std::move(id));
  return options;
}

http::TlsFiles tls_files(const Settings& settings) {
  return {.certificate = settings.text("http.tls_certificate"),
          .key = settings.text("http.tls_key"),
          .client_authorities = settings.text("http.tls_client_authorities")};
}

server::Webhooks::Options webhook_options(const Settings& settings) {
  server::Webhooks::Options options;
  options.queue = static_cast<std::size_t>(settings.integer("webhooks.queue"));
  options.now_utime_us = host_utime_us;
  options.on_error = [](const Error& error) { log_error("webhook", error); };
  return options;
}

Result<server::BatteryTopics::Options> mqtt_options(const Settings& settings) {
  server::BatteryTopics::Options options;
  Result<server::BrokerOptions> broker = server::parse_broker_url(settings.text("mqtt.url"), "mqtt.url");
  if (!broker) return tl::unexpected(std::move(broker.error()));
  for (const char* key : {"mqtt.client_id", "mqtt.interface", "mqtt.manufacturer"}) {
    const std::string& level = settings.text(key);
    if (level.empty() || level.find_first_of("/+#$") != std::string::npos)
      return invalid(key, "is a level of MQTT topics: not empty, and without /, +, # and $");
  }
  options.broker = std::move(*broker);
  options.broker.authorities = settings.text("mqtt.authorities");
  options.broker.client_id = settings.text("mqtt.client_id");
  options.broker.user = settings.text("mqtt.user");
  if (const std::string& file = settings.text("mqtt.password_file"); !file.empty()) {
    Result<std::string> password = access::read_secret(file, 1);
    if (!password) return invalid("mqtt.password_file", describe(password.error()));
    options.broker.password = std::move(*password);
  }
  options.interface = settings.text("mqtt.interface");
  options.manufacturer = settings.text("mqtt.manufacturer");
  options.dialect = settings.text("mqtt.dialect") == "vda5050-2.1" ? answers::Dialect::vda5050_2_1
                                                                   : answers::Dialect::vda5050_3_0;
  options.period = seconds(settings.number("mqtt.period_s"));
  options.now_utime_us = host_utime_us;
  options.note = [](const std::string& text) { log_info(text, {}); };
  return options;
}

http::ServerOptions http_options(const Settings& settings) {
  http::ServerOptions options;
  options.address = settings.text("http.address");
  options.port = static_cast<std::uint16_t>(settings.integer("http.port"));
  options.allowed_hosts = listed(settings.text("http.allowed_hosts"));
  options.allowed_origins = listed(settings.text("http.allowed_origins"));
  options.trusted_proxies = listed(settings.text("http.trusted_proxies"));
  options.tls = tls_files(settings);
  options.worker_threads = static_cast<unsigned>(settings.integer("http.worker_threads"));
  options.compute_threads = static_cast<unsigned>(settings.integer("http.compute_threads"));
  options.worker_queue = static_cast<std::size_t>(settings.integer("http.worker_queue"));
  options.client_requests = static_cast<std::size_t>(settings.integer("http.client_requests"));
  options.max_connections = static_cast<std::size_t>(settings.integer("http.max_connections"));
  options.client_connections = static_cast<std::size_t>(settings.integer("http.client_connections"));
  options.max_header_bytes = static_cast<std::uint32_t>(settings.integer("http.max_header_bytes"));
  options.max_body_bytes = static_cast<std::uint64_t>(settings.integer("http.max_body_bytes"));
  options.max_bodies_bytes = static_cast<std::uint64_t>(settings.integer("http.max_bodies_bytes"));
  options.read_timeout = seconds(settings.number("http.read_timeout_s"));
  options.write_timeout = seconds(settings.number("http.write_timeout_s"));
  options.idle_timeout = seconds(settings.number("http.idle_timeout_s"));
  options.request_deadline = seconds(settings.number("http.request_deadline_s"));
  return options;
}

http::EventHub::Options event_options(const Settings& settings) {
  http::EventHub::Options options;
  options.queue_bytes = static_cast<std::size_t>(settings.integer("http.event_queue_bytes"));
  options.max_subscribers = static_cast<std::size_t>(settings.integer("http.event_streams"));
  return options;
}

}  // namespace joulecast
