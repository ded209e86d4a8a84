#include "server/http/operations.h"

#include <memory>

#include "describe/table.h"
#include "server/http/event_hub.h"

namespace joulecast::http {
namespace {

using described::Table;
using Ready = std::vector<std::string>;  // the names of the checks

struct Version {
  std::string_view name = "joulecastd", version = JOULECAST_VERSION, compiler = "g++ " __VERSION__;
};

const auto readiness_table = Table<Ready>("Readiness")
                                 .value("status", [](const Ready&) { return "ready"; },
                                        "always ready; otherwise the status is 503", {{"const", "ready"}})
                                 .texts("checks", std::identity(), "name of the check");

const auto version_table =
    Table<Version>("Version of the service")
        .value("name", AT(name), "name of the program")
        .value("version", AT(version), "of the program", {{"pattern", R"(^[0-9]+\.[0-9]+\.[0-9]+)"}})
        .value("compiler", AT(compiler), "compiler of the program");

// Upper bounds of the histogram of request durations [s].
const std::vector<double> request_seconds{50e-6, 100e-6, 250e-6, 500e-6, 1e-3, 2.5e-3, 5e-3, 10e-3,
                                          25e-3, 50e-3,  100e-3, 250e-3, 0.5,  1.0,    2.5,  10.0};

std::vector<prometheus::Counter*> refusal_counters(Metrics& metrics) {
  std::vector<prometheus::Counter*> made;
  for (unsigned i = 0; i < static_cast<unsigned>(Refusal::count_); ++i)
    made.push_back(&metrics.counter("joulecast_http_refused_total",
                                    "Requests or connections that the server ended on its own, by reason",
                                    {{"reason", std::string(to_string(static_cast<Refusal>(i)))}}));
  return made;
}

}  // namespace

described::Schemas operations_schemas() {
  return {{"health", described::of_object("Liveness", {},
                                          {{"status", {{"const", "live"}, {"description", "always live"}}}})},
          {"readiness", readiness_table.schema()},
          {"version", version_table.schema()}};
}

std::vector<Endpoint> operations_endpoints(Metrics& metrics, std::vector<ReadinessCheck> checks) {
  std::vector<Endpoint> endpoints;
  const auto add = [&](Endpoint endpoint) {
    endpoint.tag = "operations";
    endpoints.push_back(std::move(endpoint));
  };
  add({.path = "/healthz",
       .operation_id = "getHealth",
       .role = Role::open,
       .summary = "The process answers",
       .response_schema = "health",
       .run = Run::io,
       .reserved = true,
       .handler = [](const Request&) -> Result<Response> { return json_response(R"({"status":"live"})"); }});
  add({.path = "/readyz",
       .operation_id = "getReadiness",
       .role = Role::open,
       .summary = "All parts of the service work",
       .response_schema = "readiness",
       .run = Run::operations,
       .reserved = true,
       .handler = [shared = std::make_shared<const std::vector<ReadinessCheck>>(std::move(checks))](
                      const Request&) -> Result<Response> {
         Ready names;
         std::string failures;
         for (const auto& [name, check] : *shared) {
           if (const auto result = check(); !result)
             failures += (failures.empty() ? "" : "; ") + name + ": " +
                         (result.error().field == name ? result.error().message : describe(result.error()));
           names.push_back(name);
         }
         if (!failures.empty()) return fail(Fault::unavailable, "", "not ready: " + failures);
         return json_response(readiness_table.text(names));
       }});
  add({.path = "/metrics",
       .operation_id = "getMetrics",
       .role = Role::read,
       .summary = "Prometheus metrics",
       .response_type = std::string(Metrics::content_type()),
       .run = Run::operations,
       .reserved = true,
       .handler = [&metrics](const Request&) -> Result<Response> {
         Response response = json_response(metrics.text());
         response.content_type = Metrics::content_type();
         return response;
       }});
  add({.path = "/version",
       .operation_id = "getVersion",
       .role = Role::read,
       .summary = "What is running",
       .response_schema = "version",
       .etag = true,
       .run = Run::io,
       .handler = [](const Request&) -> Result<Response> { return json_response(version_table.text({})); }});
  return endpoints;
}

Endpoint events_endpoint(EventHub& hub) {
  return {.path = "/v1/events",
          .operation_id = "streamEvents",
          .role = Role::read,
          .tag = "events",
          .summary =
              "The live fleet as server-sent events. A client that reconnects with Last-Event-ID gets the "
              "missed events, or an event \"reset\" if they are no longer available",
          .parameters = {{.name = "robot_id", .description = "events of this robot only"}},
          .response_type = "text/event-stream",
          .events = {{"state", "robot-state", "a robot's live state, at most once a second where it changed"},
                     {"mission", "mission", "a mission has ended"},
                     {"contradiction", "contradiction-event", "a robot's telemetry is contradicted"},
                     {"reset", "reset-event",
                      "first after a reconnection: missed events are not available, read /v1/robots again"}},
          .error_statuses = {503},
          .run = Run::io,
          .handler = [&hub](const Request& request) -> Result<Response> {
            return hub.respond(request, request.query_value("robot_id").value_or(std::string_view{}));
          }};
}

HttpMetrics::HttpMetrics(Metrics& metrics)
    : metrics_(metrics),
      refusals_(refusal_counters(metrics)),
      sent_bytes_(metrics.counter("joulecast_http_sent_bytes_total", "Bytes of answers")),
      received_bytes_(metrics.counter("joulecast_http_received_bytes_total", "Bytes of requests")) {
  metrics.series([this]() -> std::vector<Metrics::Series> {
    return {{"joulecast_http_connections", "Connections open now", connections_.load()}};
  });
}

void HttpMetrics::exchanged(const Exchange& exchange) {
  const std::pair key{exchange.operation.data(), exchange.status};
  auto place = series_.find(key);
  if (place == series_.end()) {
    const std::string operation(exchange.operation);
    prometheus::Counter& requests =
        metrics_.counter("joulecast_http_requests_total", "Requests answered",
                         {{"operation", operation}, {"code", std::to_string(exchange.status)}});
    prometheus::Histogram& duration =
        metrics_.histogram("joulecast_http_request_duration_seconds",
                           "From the last byte of a request to the last byte of its answer", request_seconds,
                           {{"operation", operation}});
    place = series_.try_emplace(key, requests, duration).first;
  }
  place->second.first.Increment();
  if (!exchange.stream) place->second.second.Observe(exchange.duration_s);
  sent_bytes_.Increment(static_cast<double>(exchange.response_bytes));
  received_bytes_.Increment(static_cast<double>(exchange.request_bytes));
}

}  // namespace joulecast::http
