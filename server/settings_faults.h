#pragma once

#include <vector>

#include "base/error.h"
#include "server/daemon_options.h"

namespace joulecast {

// All errors in the values of the settings that can be detected without opening the store or connecting to a
// broker: access to the service, the URL of the history, the cluster, accepted senders of telemetry,
// webhooks, MQTT, robot files.
std::vector<Error> faults_of(const DaemonOptions& options);

// Without tokens only loopback addresses are permitted, unless http.insecure is set. Fault::invalid on
// "http.address" or "http.allowed_origins"; unsafe settings that are permitted are logged.
Result<void> check_exposure(const DaemonOptions& options);

}  // namespace joulecast
