#pragma once

#include <cstddef>
#include <string_view>

#include "server/http/router.h"

namespace joulecast::http {

// The header with which a client marks a request as the repetition of one with a lost answer, according to
// draft-ietf-httpapi-idempotency-key-header.
inline constexpr std::string_view idempotency_header = "Idempotency-Key";
inline constexpr std::size_t longest_idempotency_key = 255;  // visible ASCII characters

// Whether requests of the endpoint may have a key: those that change stored data.
inline bool takes_idempotency_key(const Endpoint& endpoint) {
  return endpoint.method != Method::get && (endpoint.role == Role::operate || endpoint.role == Role::admin);
}

}  // namespace joulecast::http
