#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "server/http/router.h"

namespace joulecast::http {

// The header by which a client says that a request is the repetition of one whose answer it did not get, as
// draft-ietf-httpapi-idempotency-key-header defines it.
inline constexpr std::string_view idempotency_header = "Idempotency-Key";
inline constexpr std::size_t longest_idempotency_key = 255;  // visible ASCII characters

// Whether requests of the endpoint may carry a key: those that change what the service keeps.
bool takes_idempotency_key(const Endpoint& endpoint);

// Answers a repeated request as it was answered the first time, and does nothing.
class IdempotencyKeys {
 public:
  // What was answered to the actor's request under the key.
  struct Answer {
    std::string actor, key;
    std::string fingerprint;  // SHA-256 of method, target and body
    unsigned status = 0;
    std::string location;  // header; empty: none
    std::string body;
  };
  struct Options {
    std::function<Result<std::optional<Answer>>(const std::string& actor, const std::string& key)> find;
    // Of requests that changed nothing, whose handlers did not keep it; returns when it is kept, or cannot
    // be.
    std::function<void(Answer)> keep;
    std::chrono::milliseconds wait{0};  // for another daemon that is handling a request of the same key
  };

  explicit IdempotencyKeys(Options options) : options_(std::move(options)) {}

  // The same endpoint with keys honoured where it takes them. Successes alone are kept: what was refused or
  // failed may be tried again under its key. A handler that changes something commits the answer with the
  // change, under Request::kept. Refers to this object.
  Endpoint honoured(Endpoint endpoint) const;

 private:
  Result<Response> answer(const Request& request, const Handler& handler) const;
  // What was answered under the request's key, or that it was another request; absent: nothing.
  Result<std::optional<Response>> known(const Request& request) const;

  const Options options_;
};

// What is answered to a request under its key.
IdempotencyKeys::Answer answer_of(const Request& request, const Response& response);

// The Location header; empty: none.
std::string location_of(const Response& response);

}  // namespace joulecast::http
