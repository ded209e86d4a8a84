#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "describe/schema.h"
#include "server/http/router.h"

namespace joulecast {
class Metrics;
}

namespace joulecast::http {

class EventHub;

// A condition that the service requires before it can answer, e.g. {"store", [] { return writer.check(); }}.
// The function may be called from several threads at the same time and should answer within a second.
struct ReadinessCheck {
  std::string name;
  std::function<Result<void>()> check;
};

// GET /healthz, /readyz, /metrics, /version.
std::vector<Endpoint> operations_endpoints(Metrics& metrics, std::vector<ReadinessCheck> checks);

// Their schemas.
described::Schemas operations_schemas();

// GET /v1/events: the live fleet as server-sent events; ?robot_id= selects one robot.
Endpoint events_endpoint(EventHub& hub);

}  // namespace joulecast::http
