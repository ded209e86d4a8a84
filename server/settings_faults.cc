#include "server/settings_faults.h"

#include <memory>
#include <string>
#include <utility>

#include "history/open_store.h"
#include "ingest/model_loading.h"
#include "ingest/signature_gate.h"
#include "server/http/cors.h"
#include "server/http/gate.h"
#include "server/http/http_server.h"
#include "server/logging.h"
#include "server/webhooks/webhook_file.h"
#include "telemetry/datagram_socket.h"

namespace joulecast {
namespace {

std::vector<Error> faults_of_access(const DaemonOptions& options) {
  std::vector<Error> faults;
  if (const Result<void> safe = check_exposure(options); !safe) faults.push_back(safe.error());
  if (const Result<std::unique_ptr<http::Gate>> gate = http::Gate::open({.token_file = options.token_file});
      !gate)
    faults.push_back(gate.error());
  if (const http::TlsFiles& tls = options.http.tls; tls.given()) {
    if (const Result<void> sound = http::check_tls(tls); !sound) faults.push_back(sound.error());
  }
  return faults;
}

std::vector<Error> faults_of_webhooks(const DaemonOptions& options) {
  if (options.webhooks_file.empty()) return {};
  const auto webhooks = server::read_webhooks(options.webhooks_file);
  return webhooks ? std::vector<Error>{} : std::vector<Error>{webhooks.error()};
}

std::vector<Error> faults_of_mqtt(const DaemonOptions& options) {
  if (options.mqtt_url.empty()) return {};
  const auto mqtt = mqtt_options(options);
  return mqtt ? std::vector<Error>{} : std::vector<Error>{mqtt.error()};
}

std::vector<Error> faults_of_telemetry(const DaemonOptions& options) {
  std::vector<Error> faults;
  if (Result<void> keys = ingest::SignatureGate(options.ingest.signatures).read_keys(); !keys)
    faults.push_back(keys.error());
  if (const auto senders = telemetry::AcceptedSenders::parse(options.ingest.listen.accept_from); !senders)
    faults.push_back(senders.error());
  return faults;
}

std::vector<Error> faults_of_cluster(const DaemonOptions& options) {
  const auto cluster = cluster_options(options);
  return cluster ? std::vector<Error>{} : std::vector<Error>{cluster.error()};
}

std::vector<Error> faulty_robot_files(const DaemonOptions& options) {
  if (options.robots_directory.empty()) return {};
  const Result<ingest::RobotFiles> files = ingest::read_robot_files(options.robots_directory);
  return files ? files->faulty : std::vector<Error>{files.error()};
}

std::vector<Error> faults_of_store(const DaemonOptions& options) {
  const Result<void> sound = history::check_store_url(store_url(options));
  if (!sound) return {{Fault::invalid, "store.url", sound.error().message}};
  const auto store = store_options(options);
  return store ? std::vector<Error>{} : std::vector<Error>{store.error()};
}

}  // namespace

Result<void> check_exposure(const DaemonOptions& options) {
  for (const std::string& origin : options.http.allowed_origins)
    if (Result<void> sound = http::check_origin(origin); !sound) return sound;
  const std::string& address = options.http.address;
  if (http::is_loopback(address)) return {};
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
                     ", which other hosts can reach, but auth.token_file is not set: make one with "
                     "joulecast token create, listen on 127.0.0.1, or set http.insecure");
}

std::vector<Error> faults_of(const DaemonOptions& options) {
  std::vector<Error> all;
  for (const auto part : {faults_of_access, faults_of_store, faults_of_cluster, faults_of_telemetry,
                          faults_of_webhooks, faults_of_mqtt, faulty_robot_files})
    for (Error& error : part(options)) all.push_back(std::move(error));
  return all;
}

}  // namespace joulecast
