#pragma once

#include <cstddef>
#include <string_view>

#include "server/http/router.h"

namespace joulecast::http {

// The header by which a client says that a request is the repetition of one whose answer it did not get, as
// draft-ietf-httpapi-idempotency-key-header defines it.
inline constexpr std::string_view idempotency_header = "Idempotency-Key";
inline constexpr std::size_t longest_idempotency_key = 255;  // visible ASCII characters

// Whether requests of the endpoint may carry a key: those that change what the service keeps.
inline bool takes_idempotency_key(const Endpoint& endpoint) {
  return endpoint.method != Method::get && (endpoint.role == Role::operate || endpoint.role == Role::admin);
}

}  // namespace joulecast::http
