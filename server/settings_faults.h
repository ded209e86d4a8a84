#pragma once

#include <vector>

#include "base/error.h"
#include "server/settings.h"

namespace joulecast {

// Everything that is wrong with what the settings name, without opening the store or asking a broker: who may
// use the service, the URL of the history, the part in a cluster, whose telemetry is taken, webhooks, MQTT,
// robot files.
std::vector<Error> faults_of(const Settings& settings);

// Without tokens only this machine is served, unless the settings say otherwise. Fault::invalid on
// "http.address" or "http.allowed_origins"; what is allowed and unsafe is logged.
Result<void> check_exposure(const Settings& settings);

}  // namespace joulecast
