#include "server/http/cors.h"

#include <algorithm>

namespace joulecast::http {
namespace {

// How long a browser may cache the answer to a preflight request.
constexpr const char* preflight_age_s = "600";

}  // namespace

bool Cors::allows(std::string_view origin) const {
  return std::ranges::find(origins_, origin) != origins_.end();
}

void Cors::add_headers(const Request& request, Response& response) const {
  if (origins_.empty()) return;
  response.headers.emplace_back("Vary", "Origin");
  const std::string origin(request.header("origin"));
  if (!allows(origin)) return;
  response.headers.emplace_back("Access-Control-Allow-Origin", origin);
  if (request.method == Method::options && !request.header("access-control-request-method").empty()) {
    const std::string methods(response.header("Allow"));
    response.headers.emplace_back("Access-Control-Allow-Methods", methods);
    response.headers.emplace_back(
        "Access-Control-Allow-Headers",
        "Accept, Authorization, Cache-Control, Content-Type, Idempotency-Key, If-None-Match, Last-Event-ID, "
        "X-Request-Id");
    response.headers.emplace_back("Access-Control-Max-Age", preflight_age_s);
  } else {
    response.headers.emplace_back("Access-Control-Expose-Headers",
                                  "Deprecation, ETag, Idempotency-Replayed, Link, Location, Retry-After, "
                                  "WWW-Authenticate, X-Request-Id");
  }
}

Result<void> check_origin(std::string_view origin) {
  const auto scheme = origin.find("://");
  const std::string_view kind = origin.substr(0, std::min(scheme, origin.size()));
  const std::string_view host = scheme == std::string_view::npos ? "" : origin.substr(scheme + 3);
  const bool plain =
      host.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789.-:[]") == std::string_view::npos;
  if ((kind == "http" || kind == "https") && !host.empty() && plain) return {};
  return invalid("http.allowed_origins",
                 "has " + std::string(origin) +
                     ", must be origins such as https://fleet.example or http://10.0.0.7:3000, in lower case "
                     "and without a path");
}

}  // namespace joulecast::http
