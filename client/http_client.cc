#include "client/http_client.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <utility>

namespace joulecast::client {

Result<ServerAddress> parse_server_url(std::string_view url) {
  const std::string given(url);
  const bool tls = url.starts_with("https://");
  if (tls || url.starts_with("http://")) {
    url.remove_prefix(tls ? 8 : 7);
  } else if (url.find("://") != std::string_view::npos) {
    return invalid("--server", given + " must begin with http:// or https://");
  }
  const std::size_t slash = std::min(url.find('/'), url.size());
  std::string_view authority = url.substr(0, slash);
  std::string_view path = url.substr(slash);
  while (path.ends_with('/')) path.remove_suffix(1);
  ServerAddress address{{}, tls ? "443" : "80", std::string(path), tls};
  // A colon inside brackets belongs to an IPv6 address.
  const std::size_t bracket = authority.rfind(']');
  const std::size_t colon = authority.rfind(':');
  if (colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket)) {
    address.port = std::string(authority.substr(colon + 1));
    authority = authority.substr(0, colon);
    const bool digits = std::all_of(address.port.begin(), address.port.end(),
                                    [](unsigned char c) { return std::isdigit(c) != 0; });
    if (address.port.empty() || address.port.size() > 5 || !digits || std::stoi(address.port) > 65535) {
      return invalid("--server", given + " has no valid port");
    }
  }
  if (authority.starts_with('[') && authority.ends_with(']'))
    authority = authority.substr(1, authority.size() - 2);
  if (authority.empty()) return invalid("--server", given + " names no host");
  address.host = std::string(authority);
  return address;
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
  // What is wrong with one field is said as if it had been found here.
  if (const std::string field = text("field"), constraint = text("constraint");
      !field.empty() && !constraint.empty())
    return {fault, field, constraint + " (" + answered + ")"};
  std::string message = answered;
  for (const char* key : {"title", "detail"})
    if (const std::string said = text(key); !said.empty()) message += ": " + said;
  return {fault, {}, message};
}

}  // namespace joulecast::client
