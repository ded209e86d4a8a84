#include "server/http/operations.h"

#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/http/event_hub.h"
#include "server/metrics.h"

namespace joulecast::http {

std::vector<Endpoint> operations_endpoints(Metrics& metrics, std::vector<ReadinessCheck> checks) {
  std::vector<Endpoint> endpoints;

  Endpoint health;
  health.path = "/healthz";
  health.operation_id = "getHealth";
  health.role = Role::open;
  health.tag = "operations";
  health.summary = "The process answers";
  health.response_schema = "health";
  health.run = Run::io;
  health.reserved = true;
  health.handler = [](const Request&) -> Result<Response> { return json_response(R"({"status":"live"})"); };
  endpoints.push_back(std::move(health));

  Endpoint ready;
  ready.path = "/readyz";
  ready.operation_id = "getReadiness";
  ready.role = Role::open;
  ready.tag = "operations";
  ready.summary = "All parts of the service can do their work";
  ready.response_schema = "readiness";
  ready.run = Run::operations;
  ready.reserved = true;
  ready.handler = [shared = std::make_shared<const std::vector<ReadinessCheck>>(std::move(checks))](
                      const Request&) -> Result<Response> {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    std::string failures;
    for (const auto& [name, check] : *shared) {
      if (const auto result = check(); !result) {
        failures += (failures.empty() ? "" : "; ") + name + ": " + describe(result.error());
      }
      names.push_back(name);
    }
    if (!failures.empty()) return fail(Fault::unavailable, "", "not ready: " + failures);
    return json_response(nlohmann::ordered_json{{"status", "ready"}, {"checks", std::move(names)}}.dump());
  };
  endpoints.push_back(std::move(ready));

  Endpoint scrape;
  scrape.path = "/metrics";
  scrape.operation_id = "getMetrics";
  scrape.role = Role::read;
  scrape.tag = "operations";
  scrape.summary = "Prometheus metrics";
  scrape.response_type = Metrics::content_type();
  scrape.run = Run::operations;
  scrape.reserved = true;
  scrape.handler = [&metrics](const Request&) -> Result<Response> {
    Response response;
    response.content_type = Metrics::content_type();
    response.body = metrics.text();
    return response;
  };
  endpoints.push_back(std::move(scrape));

  Endpoint version;
  version.path = "/version";
  version.operation_id = "getVersion";
  version.role = Role::read;
  version.tag = "operations";
  version.summary = "What is running";
  version.response_schema = "version";
  version.etag = true;
  version.run = Run::io;
  version.handler = [](const Request&) -> Result<Response> {
    return json_response(nlohmann::ordered_json{
        {"name", "joulecastd"}, {"version", JOULECAST_VERSION}, {"compiler", "g++ " __VERSION__}}
                             .dump());
  };
  endpoints.push_back(std::move(version));
  return endpoints;
}

Endpoint events_endpoint(EventHub& hub) {
  Endpoint endpoint;
  endpoint.path = "/v1/events";
  endpoint.operation_id = "streamEvents";
  endpoint.role = Role::read;
  endpoint.tag = "events";
  endpoint.summary =
      "The live fleet as server-sent events. A returning client's Last-Event-ID gets it what it missed, or "
      "an event "
      "\"reset\" when that is no longer known";
  endpoint.parameters = {{.name = "robot_id", .description = "events of this robot only"}};
  endpoint.response_type = "text/event-stream";
  endpoint.events = {
      {"state", "robot-state", "a robot's live state, at most once a second where it changed"},
      {"mission", "mission", "a mission has ended"},
      {"contradiction", "contradiction-event", "something contradicts a robot's telemetry"},
      {"reset", "reset-event", "first after a return: what was missed is not kept, read /v1/robots afresh"}};
  endpoint.error_statuses = {503};
  endpoint.run = Run::io;
  endpoint.handler = [&hub](const Request& request) -> Result<Response> {
    return hub.respond(request, request.query_value("robot_id").value_or(std::string_view{}));
  };
  return endpoint;
}

}  // namespace joulecast::http
