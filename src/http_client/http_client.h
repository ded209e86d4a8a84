#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

// Requests to HTTP servers: the command line to joulecastd, joulecastd to those that listen to its webhooks.
namespace joulecast::http_client {

struct ServerAddress {
  std::string host;
  std::string port;
  std::string base_path;  // without a slash at the end; empty for the root
  bool tls = false;       // https
};

// "[http[s]://]host[:port][/path]"; the port defaults to 80, for https to 443. Fault::invalid on `field` for
// anything else, without the URL: it may hold a secret.
[[nodiscard]] Result<ServerAddress> parse_url(std::string_view url, const std::string& field);

struct HttpReply {
  unsigned status = 0;
  std::string content_type;
  std::string body;
  std::string link;  // header Link: where the next page is

  bool ok() const { return status >= 200 && status < 300; }
};

enum class HttpMethod : std::uint8_t { get, post, put, del };

// PEM files that a client shows to a server that asks for a certificate; empty: none.
struct ClientCertificate {
  std::string file, key_file;
};

struct HttpRequest {
  HttpMethod method = HttpMethod::get;
  std::string target;     // appended to the address's base path; begins with a slash, or is empty
  std::string json_body;  // with POST and PUT
  std::vector<std::pair<std::string, std::string>> headers = {};
  ClientCertificate certificate = {};
  bool status_only = false;  // the reply's body is not received
};

// One request on its own connection; redirections are not followed. With https the server's certificate must
// be of that host and of an authority that the system or SSL_CERT_FILE trusts. Fault::unavailable when the
// server cannot be reached or does not answer within `timeout` (for the whole exchange); a reply of any
// status is a success here.
[[nodiscard]] Result<HttpReply> exchange(const ServerAddress& server, const HttpRequest& request,
                                         std::chrono::milliseconds timeout);

}  // namespace joulecast::http_client
