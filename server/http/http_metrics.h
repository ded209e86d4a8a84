#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "server/http/http_server.h"
#include "server/metrics.h"

namespace joulecast::http {

// Counts the server's events. Labels are bounded: operations come from the table of endpoints, statuses from
// the code that answers.
class HttpMetrics : public ServerObserver {
 public:
  // The table lives as long as the router, which outlives this. `log` may be empty.
  HttpMetrics(Metrics& metrics, std::function<void(const Exchange&)> log = {});

  void exchanged(const Exchange& exchange) override;
  void refused(Refusal refusal) override;
  void connections(std::size_t open) override;

 private:
  struct Series {
    Counter requests;
    Histogram duration;
  };
  Metrics& metrics_;
  std::function<void(const Exchange&)> log_;
  std::map<std::pair<const char*, unsigned>, Series> series_;  // by operation and status; I/O thread only
  std::vector<Counter> refusals_;
  Counter sent_bytes_;
  Counter received_bytes_;
  Gauge connections_;
};

}  // namespace joulecast::http
