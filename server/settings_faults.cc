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
#include "server/options_of_settings.h"
#include "server/webhooks/webhook_file.h"
#include "telemetry/datagram_socket.h"

namespace joulecast {
namespace {

std::vector<Error> faults_of_access(const Settings& settings) {
  std::vector<Error> faults;
  if (const Result<void> safe = check_exposure(settings); !safe) faults.push_back(safe.error());
  if (const Result<std::unique_ptr<http::Gate>> gate =
          http::Gate::open({.token_file = settings.text("auth.token_file")});
      !gate)
    faults.push_back(gate.error());
  if (const http::TlsFiles tls = tls_files(settings); tls.given()) {
    if (const Result<void> sound = http::check_tls(tls); !sound) faults.push_back(sound.error());
  }
  return faults;
}

std::vector<Error> faults_of_webhooks(const Settings& settings) {
  const std::string& file = settings.text("webhooks.file");
  if (file.empty()) return {};
  const auto webhooks = server::read_webhooks(file);
  return webhooks ? std::vector<Error>{} : std::vector<Error>{webhooks.error()};
}

std::vector<Error> faults_of_mqtt(const Settings& settings) {
  if (settings.text("mqtt.url").empty()) return {};
  const auto options = mqtt_options(settings);
  return options ? std::vector<Error>{} : std::vector<Error>{options.error()};
}

std::vector<Error> faults_of_telemetry(const Settings& settings) {
  std::vector<Error> faults;
  const ingest::IngestOptions options = ingest_options(settings);
  if (Result<void> keys = ingest::SignatureGate(options.signatures).read_keys(); !keys)
    faults.push_back(keys.error());
  if (const auto senders = telemetry::AcceptedSenders::parse(options.listen.accept_from); !senders)
    faults.push_back(senders.error());
  return faults;
}

std::vector<Error> faults_of_cluster(const Settings& settings) {
  const auto options = cluster_options(settings);
  return options ? std::vector<Error>{} : std::vector<Error>{options.error()};
}

std::vector<Error> faulty_robot_files(const Settings& settings) {
  const std::string& directory = settings.text("robots.directory");
  if (directory.empty()) return {};
  const Result<ingest::RobotFiles> files = ingest::read_robot_files(directory);
  return files ? files->faulty : std::vector<Error>{files.error()};
}

std::vector<Error> faults_of_store(const Settings& settings) {
  const Result<void> sound = history::check_store_url(store_url(settings));
  if (!sound) return {{Fault::invalid, "store.url", sound.error().message}};
  const auto store = store_options(settings);
  return store ? std::vector<Error>{} : std::vector<Error>{store.error()};
}

}  // namespace

Result<void> check_exposure(const Settings& settings) {
  const std::vector<std::string> origins = http_options(settings).allowed_origins;
  for (const std::string& origin : origins)
    if (Result<void> sound = http::check_origin(origin); !sound) return sound;
  const std::string& address = settings.text("http.address");
  if (http::is_loopback(address)) return {};
  if (!settings.text("auth.token_file").empty()) {
    if (settings.text("http.tls_certificate").empty())
      log_warning(
          "tokens travel unencrypted to this address: set http.tls_certificate, or listen on 127.0.0.1 "
          "behind a TLS proxy",
          {{"address", address}});
    return {};
  }
  if (settings.boolean("http.insecure")) {
    log_warning("every client that reaches this address has all permissions (http.insecure)",
                {{"address", address}});
    return {};
  }
  return invalid("http.address",
                 "is " + address +
                     ", which other hosts can reach, but auth.token_file is not set: make one with "
                     "joulecast token create, listen on 127.0.0.1, or set http.insecure");
}

std::vector<Error> faults_of(const Settings& settings) {
  std::vector<Error> all;
  for (const auto part : {faults_of_access, faults_of_store, faults_of_cluster, faults_of_telemetry,
                          faults_of_webhooks, faults_of_mqtt, faulty_robot_files})
    for (Error& error : part(settings)) all.push_back(std::move(error));
  return all;
}

}  // namespace joulecast
