#include "server/settings_faults.h"

#include <string>

#include "history/open_store.h"
#include "ingest/model_loading.h"
#include "ingest/signature_gate.h"
#include "server/http/cors.h"
#include "server/http/gate.h"
#include "server/http/http_server.h"
#include "server/logging.h"
#include "server/webhooks/webhooks.h"
#include "telemetry/datagram_socket.h"

namespace joulecast {

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
                     ", which other hosts can reach, but auth.token_file is not set: make one with joulecast "
                     "token create, listen on 127.0.0.1, or set http.insecure");
}

std::vector<Error> faults_of(const DaemonOptions& options) {
  std::vector<Error> faults;
  const auto check = [&faults](const auto& result) {
    if (!result) faults.push_back(result.error());
  };
  check(check_exposure(options));
  check(http::Gate::open({.token_file = options.token_file}));
  if (options.http.tls.given()) check(http::check_tls(options.http.tls));
  if (const Result<void> sound = history::check_store_url(store_url(options)); !sound)
    faults.push_back({Fault::invalid, "store.url", sound.error().message});
  else
    check(store_options(options));
  check(cluster_options(options));
  check(ingest::SignatureGate(options.ingest.signatures).read_keys());
  check(telemetry::AcceptedSenders::parse(options.ingest.listen.accept_from));
  if (!options.webhooks_file.empty()) check(server::read_webhooks(options.webhooks_file));
  if (!options.mqtt_url.empty()) check(mqtt_options(options));
  if (options.robots_directory.empty()) return faults;
  const Result<ingest::RobotFiles> files = ingest::read_robot_files(options.robots_directory);
  check(files);
  if (files) faults.insert(faults.end(), files->faulty.begin(), files->faulty.end());
  return faults;
}

}  // namespace joulecast
