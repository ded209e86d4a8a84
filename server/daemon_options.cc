#include "server/daemon_options.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/ssl/context.hpp>
#include <utility>

#include "access/secret_file.h"
#include "base/host_clock.h"
#include "base/try.h"
#include "ingest/model_registry.h"
#include "ingest/signature_gate.h"
#include "server/http/admission.h"
#include "server/http/delivery.h"
#include "server/http/gate.h"
#include "server/http/static_files.h"
#include "telemetry/datagram_socket.h"
#include "telemetry/lcm_link.h"

namespace joulecast {

DaemonOptions::DaemonOptions() {
  http.port = 8080;
  ingest.lcm_url = telemetry::default_lcm_url;
  ingest.session.mission.explicit_silence_us = 300'000'000;
  ingest.session.max_ahead_us = 300'000'000;
  writer.retention.telemetry_max_age_us = 30 * 86'400'000'000LL;
  writer.retention.telemetry_max_bytes = 10LL << 30;
  writer.events_kept = 1'000'000;
  writer.audit_max_age_us = 365 * 86'400'000'000LL;
  writer.on_error = [](const Error& error) { log_error("store", error); };
  writer.on_recovery = [] { log_info("store: commits succeed again"); };
  webhooks.now_utime_us = host_utime_us;
  webhooks.on_error = [](const Error& error) { log_error("webhook", error); };
  mqtt.broker.client_id = mqtt.interface = "joulecast";
  mqtt.manufacturer = "unknown";
  mqtt.now_utime_us = host_utime_us;
  mqtt.on_change = [](const std::string& why) {
    why.empty() ? log_info("the MQTT broker is connected")
                : log_warning("the MQTT broker is not connected", {{"cause", why}});
  };
}

std::string store_url(const DaemonOptions& options) {
  return options.store_url.empty() ? "sqlite:" + options.store_path : options.store_url;
}

std::string spool_path(const DaemonOptions& options) {
  const std::string url = store_url(options);
  return (history::is_postgres_url(url) ? options.store_path : history::sqlite_path(url)) + ".spool";
}

Result<server::ClusterOptions> cluster_options(const DaemonOptions& options) {
  constexpr std::size_t longest_name = 64;
  server::ClusterOptions cluster = options.cluster;
  if (cluster.name.empty()) {
    if (!cluster.node.empty())
      return invalid("cluster.node", "names a daemon of a cluster, and no cluster.name is set");
    return cluster;
  }
  cluster.url = store_url(options);
  if (!history::is_postgres_url(cluster.url))
    return invalid("cluster.name",
                   "daemons share a fleet through a PostgreSQL: set store.url to postgresql://...");
  if (cluster.node.empty()) {
    std::array<char, 256> host{};
    if (gethostname(host.data(), host.size() - 1) == 0) cluster.node = host.data();
  }
  for (const auto& [key, text] : {std::pair("cluster.name", cluster.name), {"cluster.node", cluster.node}}) {
    if (text.empty() || text.size() > longest_name)
      return invalid(key, "must have 1 to " + std::to_string(longest_name) + " bytes");
  }
  cluster.writer = history::new_writer_name();
  return cluster;
}

Result<server::BatteryTopics::Options> mqtt_options(const DaemonOptions& options) {
  server::BatteryTopics::Options mqtt = options.mqtt;
  TRY(mqtt.broker.set_url(options.mqtt_url));
  for (const auto& [key, level] : {std::pair("mqtt.client_id", mqtt.broker.client_id),
                                   {"mqtt.interface", mqtt.interface},
                                   {"mqtt.manufacturer", mqtt.manufacturer}}) {
    if (level.empty() || level.find_first_of("/+#$") != std::string::npos)
      return invalid(key, "is a level of MQTT topics: not empty, and without /, +, # and $");
  }
  if (const std::string& file = options.mqtt_password_file; !file.empty()) {
    if (mqtt.broker.user.empty())
      return invalid("mqtt.password_file", "requires mqtt.user: MQTT has no password without a user name");
    Result<std::string> password = access::read_secret(file, 1);
    if (!password) return invalid("mqtt.password_file", describe(password.error()));
    mqtt.broker.password = std::move(*password);
  }
  if (const std::string& file = mqtt.broker.authorities; !file.empty()) {
    boost::system::error_code error;
    boost::asio::ssl::context(boost::asio::ssl::context::tls_client).load_verify_file(file, error);
    if (error) return invalid("mqtt.authorities", "cannot use " + file + ": " + error.message());
  }
  return mqtt;
}

Result<void> check_exposure(const DaemonOptions& options) {
  for (const std::string& origin : options.http.allowed_origins) TRY(http::check_origin(origin));
  for (const std::string& host : options.http.allowed_hosts) {
    if (host != "*" && (host.find_first_of("/*") != std::string::npos || std::ranges::count(host, ':') == 1))
      return invalid("http.allowed_hosts",
                     "has " + host + ", must be names such as fleet.example, without scheme and port, or *");
  }
  const std::string& address = options.http.address;
  TRY_ASSIGN(const auto listening, http::address_of(address, "http.address"));
  if (listening.is_loopback()) return {};
  if (!options.token_file.empty()) {
    if (options.http.tls.certificate.empty())
      log_warning(
          "tokens are sent unencrypted to this address: set http.tls_certificate, or listen on 127.0.0.1 "
          "behind a TLS proxy",
          {{"address", address}});
    return {};
  }
  if (options.insecure) {
    log_warning("every client that reaches this address has all permissions (http.insecure)",
                {{"address", address}});
    return {};
  }
  return invalid("http.address",
                 "is " + address +
                     ", which other hosts can reach, but auth.token_file is not set: make one with joulecast "
                     "token create, listen on 127.0.0.1, or set http.insecure");
}

std::vector<Error> faults_of(const DaemonOptions& options) {
  std::vector<Error> faults;
  const auto check = [&faults](const auto& result) {
    if (!result) faults.push_back(result.error());
  };
  check(check_exposure(options));
  check(http::parse_proxies(options.http.trusted_proxies));
  check(http::Gate::open({.token_file = options.token_file}));
  if (options.http.tls.given()) check(http::check_tls(options.http.tls));
  if (const Result<void> sound = history::check_store_url(store_url(options)); !sound)
    faults.push_back({Fault::invalid, "store.url", sound.error().message});
  check(cluster_options(options));
  check(ingest::SignatureGate(options.ingest.signatures).read_keys());
  check(telemetry::check_lcm_url(options.ingest.lcm_url));
  check(telemetry::parse_interface(options.ingest.listen.interface_address));
  check(telemetry::AcceptedSenders::parse(options.ingest.listen.accept_from));
  if (!options.web_directory.empty()) check(http::asset_endpoints_from(options.web_directory));
  if (!options.webhooks_file.empty()) check(server::read_webhooks(options.webhooks_file));
  if (!options.mqtt_url.empty()) check(mqtt_options(options));
  if (options.robots_directory.empty()) return faults;
  const Result<ingest::RobotFiles> files = ingest::read_robot_files(options.robots_directory);
  check(files);
  if (files) faults.insert(faults.end(), files->faulty.begin(), files->faulty.end());
  return faults;
}

}  // namespace joulecast
