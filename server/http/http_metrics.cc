#include "server/http/http_metrics.h"

namespace joulecast::http {
namespace {

std::vector<std::string> refusal_names() {
  std::vector<std::string> names;
  for (unsigned i = 0; i < static_cast<unsigned>(Refusal::count_); ++i)
    names.emplace_back(to_string(static_cast<Refusal>(i)));
  return names;
}

}  // namespace

HttpMetrics::HttpMetrics(Metrics& metrics, std::function<void(const Exchange&)> log)
    : metrics_(metrics),
      log_(std::move(log)),
      refusals_(metrics.counters("joulecast_http_refused_total",
                                 "Requests or connections that the server ended on its own, by reason",
                                 "reason", refusal_names())),
      sent_bytes_(metrics.counter("joulecast_http_sent_bytes_total", "Bytes of answers")),
      received_bytes_(metrics.counter("joulecast_http_received_bytes_total", "Bytes of requests")),
      connections_(metrics.gauge("joulecast_http_connections", "Connections open now")) {}

void HttpMetrics::exchanged(const Exchange& exchange) {
  auto [place, fresh] = series_.try_emplace({exchange.operation.data(), exchange.status});
  if (fresh) {
    const std::string operation(exchange.operation);
    place->second.requests =
        metrics_.counter("joulecast_http_requests_total", "Requests answered",
                         {{"operation", operation}, {"code", std::to_string(exchange.status)}});
    place->second.duration =
        metrics_.histogram("joulecast_http_request_duration_seconds",
                           "From the last byte of a request to the last byte of its answer",
                           Metrics::request_seconds(), {{"operation", operation}});
  }
  place->second.requests.add();
  if (!exchange.stream) place->second.duration.observe(exchange.duration_s);
  sent_bytes_.add(static_cast<double>(exchange.response_bytes));
  received_bytes_.add(static_cast<double>(exchange.request_bytes));
  if (log_) log_(exchange);
}

void HttpMetrics::refused(Refusal refusal) {
  refusals_[static_cast<std::size_t>(refusal)].add();
}

void HttpMetrics::connections(std::size_t open) {
  connections_.set(static_cast<double>(open));
}

}  // namespace joulecast::http
