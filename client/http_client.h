#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "base/error.h"
#include "http_client/http_client.h"

namespace joulecast::client {

using http_client::HttpMethod;
using http_client::HttpReply;
using http_client::ServerAddress;

// The address of --server; see http_client::parse_url().
[[nodiscard]] Result<ServerAddress> parse_server_url(std::string_view url);

inline constexpr const char* accept_json = "application/json, application/problem+json, text/html;q=0.5";

// http_client::exchange(), with the token of the environment's JOULECAST_TOKEN and the certificate
// of the PEM file JOULECAST_CLIENT_CERTIFICATE, of the key in JOULECAST_CLIENT_KEY.
[[nodiscard]] Result<HttpReply> http_request(const ServerAddress& server, HttpMethod method,
                                             std::string_view target, std::string json_body,
                                             std::chrono::milliseconds timeout,
                                             const std::string& accept = accept_json);

// The error of a reply other than 2xx: title and detail of its problem+json, and the fault of its status.
[[nodiscard]] Error error_of(const HttpReply& reply);

}  // namespace joulecast::client
