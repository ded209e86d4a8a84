#include "client/http_client.h"

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <utility>

namespace joulecast::client {
namespace {

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

}  // namespace

Result<ServerAddress> parse_server_url(std::string_view url) {
  return http_client::parse_url(url, "--server");
}

Result<HttpReply> http_request(const ServerAddress& server, HttpMethod method, std::string_view target,
                               std::string json_body, std::chrono::milliseconds timeout,
                               const std::string& accept) {
  http_client::HttpRequest request{method, std::string(target), std::move(json_body), {{"Accept", accept}}};
  if (const std::string token = environment("JOULECAST_TOKEN"); !token.empty())
    request.headers.emplace_back("Authorization", "Bearer " + token);
  request.certificate = {environment("JOULECAST_CLIENT_CERTIFICATE"), environment("JOULECAST_CLIENT_KEY")};
  return http_client::exchange(server, request, timeout);
}

Error error_of(const HttpReply& reply) {
  Fault fault = Fault::unavailable;
  if (reply.status == 404) {
    fault = Fault::not_found;
  } else if (reply.status == 409 || reply.status == 412) {
    fault = Fault::conflict;
  } else if (reply.status == 413) {
    fault = Fault::too_large;
  } else if (reply.status >= 400 && reply.status < 500 && reply.status != 429) {
    fault = Fault::invalid;
  }
  const std::string answered = "the server answered " + std::to_string(reply.status);
  const auto problem = nlohmann::json::parse(reply.body, nullptr, false);
  const auto text = [&problem](const char* key) {
    if (!problem.is_object()) return std::string();
    const auto at = problem.find(key);
    return at != problem.end() && at->is_string() ? at->get<std::string>() : std::string();
  };
  if (text("type") == "urn:joulecast:problem:infeasible") fault = Fault::infeasible;
  // An error of one field has the form of an error detected by the client.
  if (const std::string field = text("field"), constraint = text("constraint");
      !field.empty() && !constraint.empty())
    return {fault, field, constraint + " (" + answered + ")"};
  std::string message = answered;
  for (const char* key : {"title", "detail"})
    if (const std::string said = text(key); !said.empty()) message += ": " + said;
  return {fault, {}, message};
}

}  // namespace joulecast::client
