#include "server/api/services.h"

namespace joulecast::api {

std::vector<http::Endpoint> event_endpoints(Services& services) {
  std::vector<http::Endpoint> rows;
  rows.push_back({.method = http::Method::get,
                  .path = "/v1/events",
                  .operation_id = "streamFleet",
                  .summary = "The live fleet as server-sent events: `state` for each live robot once a "
                             "second, `mission` when one ends",
                  .parameters = {{.name = "robot_id",
                                  .type = http::Parameter::Type::text,
                                  .description = "only this robot"}},
                  .response_type = "text/event-stream",
                  .run = http::Run::io,
                  .handler = [&services](const http::Request& r) {
                    return services.events.respond(r, r.query_value("robot_id").value_or(""));
                  }});
  return rows;
}

}  // namespace joulecast::api
