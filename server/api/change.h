#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "history/commands.h"
#include "server/api/services.h"

namespace joulecast::api {

// The change that a request makes: one transaction with its entry in the audit and, under its idempotency
// key, its answer.
class RequestChange {
 public:
  // From the outcome of the change. Called on the writer's thread: it refers to nothing that ends before the
  // services.
  using Answer = std::function<http::Response(std::int64_t outcome)>;

  RequestChange(const Services& services, const http::Request& request)
      : services_(services), request_(request) {}

  // The transaction's records of the request, to which a command is added.
  history::Change answered_by(Answer answer);

  // The answer, once the transaction is committed, or why it is not.
  template <class T>
  Result<http::Response> result(const Result<T>& committed) {
    return committed ? finish({}) : finish(tl::unexpected(committed.error()));
  }

 private:
  Result<http::Response> finish(Result<void> committed);

  const Services& services_;
  const http::Request& request_;
  std::shared_ptr<std::optional<http::Response>> response_;  // made within the transaction
};

}  // namespace joulecast::api
