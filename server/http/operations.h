#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "describe/schema.h"
#include "server/http/http_server.h"
#include "server/http/router.h"
#include "server/metrics.h"

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

described::Schemas operations_schemas();

// GET /v1/events: the live fleet as server-sent events; ?robot_id= selects one robot.
Endpoint events_endpoint(EventHub& hub);

// Counts the server's events. Labels are bounded: operations of the table of endpoints and their statuses.
class HttpMetrics : public ServerObserver {
 public:
  // The table lives as long as the router, which outlives this.
  explicit HttpMetrics(Metrics& metrics);

  void exchanged(const Exchange& exchange) override;
  void refused(Refusal refusal) override { refusals_[static_cast<std::size_t>(refusal)]->Increment(); }
  void connections(std::size_t open) override { connections_ = open; }

 private:
  using Series = std::pair<prometheus::Counter&, prometheus::Histogram&>;  // requests, their durations
  Metrics& metrics_;
  std::map<std::pair<const char*, unsigned>, Series> series_;  // by operation and status; I/O thread only
  std::vector<prometheus::Counter*> refusals_;
  prometheus::Counter& sent_bytes_;
  prometheus::Counter& received_bytes_;
  std::atomic<std::size_t> connections_ = 0;
};

}  // namespace joulecast::http
