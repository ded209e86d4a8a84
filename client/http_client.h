#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "base/error.h"

namespace joulecast::client {

struct ServerAddress {
  std::string host;
  std::string port;
  std::string base_path;  // without a slash at the end; empty for the root
  bool tls = false;       // https
};

// "[http[s]://]host[:port][/path]"; the port defaults to 80, for https to 443. Fault::invalid for anything
// else.
[[nodiscard]] Result<ServerAddress> parse_server_url(std::string_view url);

struct HttpReply {
  unsigned status = 0;
  std::string content_type;
  std::string body;

  bool ok() const { return status >= 200 && status < 300; }
};

enum class HttpMethod { get, post, put, del };

// One request on its own connection. `target` begins with a slash; `json_body` is sent with GET and DELETE
// not at all. The token of the environment's JOULECAST_TOKEN goes with it. With https the server's
// certificate must be of that host and of an authority that the system or SSL_CERT_FILE trusts, and this
// client shows the certificate of the PEM file JOULECAST_CLIENT_CERTIFICATE, of the key in
// JOULECAST_CLIENT_KEY. Fault::unavailable when the server cannot be reached or does not answer within
// `timeout` (for the whole exchange); a reply of any status is a success here.
[[nodiscard]] Result<HttpReply> http_request(const ServerAddress& server, HttpMethod method,
                                             std::string_view target, std::string json_body,
                                             std::chrono::milliseconds timeout);

// The error that a reply other than 2xx stands for: problem+json's title and detail, and the fault of its
// status.
[[nodiscard]] Error error_of(const HttpReply& reply);

}  // namespace joulecast::client
