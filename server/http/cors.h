#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "server/http/message.h"

namespace joulecast::http {

// Pages of other origins that browsers let use the service (Fetch standard, CORS). They authenticate by a
// token: cookies are not sent there, since a session's is SameSite=Strict.
class Cors {
 public:
  explicit Cors(std::vector<std::string> allowed_origins) : origins_(std::move(allowed_origins)) {}

  bool allows(std::string_view origin) const;

  // Adds the headers that the browser requires in an answer, and in the answer to a preflight request.
  void add_headers(const Request& request, Response& response) const;

 private:
  std::vector<std::string> origins_;
};

// Fault::invalid for a text that is no origin, "https://name" or "http://name:port", in lower case.
Result<void> check_origin(std::string_view origin);

}  // namespace joulecast::http
