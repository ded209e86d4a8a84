#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "history/commands.h"
#include "history/records.h"
#include "server/api/services.h"
#include "server/http/router.h"

namespace joulecast::api {

// The change that a request makes: a transaction with its audit entry and, under a key, its answer.
class RequestChange {
 public:
  // From the outcome of the change, on the writer's thread: refers to nothing that ends before the services.
  using Answer = std::function<Response(std::int64_t outcome)>;

  RequestChange(const Services& services, const Request& request) : services_(services), request_(request) {}

  // The transaction: the command and the records of the request.
  history::Change answered_by(Answer answer, std::optional<history::Command> command = {});

  // Executes the command in a transaction that is answered with the JSON text.
  Result<Response> execute(history::Command command, std::string text);

  // The answer, once the transaction is committed, or why it is not.
  template <class T>
  Result<Response> result(const Result<T>& committed) {
    return committed ? finish({}) : finish(tl::unexpected(committed.error()));
  }

 private:
  Result<Response> finish(Result<void> committed);

  const Services& services_;
  const Request& request_;
  std::shared_ptr<std::optional<Response>> response_;  // made within the transaction
};

// Answers a repeated request as it was answered the first time, and does nothing.
class IdempotencyKeys {
 public:
  struct Options {
    std::function<Result<std::optional<history::RequestAnswer>>(const std::string& actor,
                                                                const std::string& key)>
        find;
    // Keeps the answer of a request that changed nothing; returns when it is kept, or cannot be.
    std::function<void(history::RequestAnswer)> keep;
    std::chrono::milliseconds wait{0};  // for another daemon that is handling a request of the same key
  };

  explicit IdempotencyKeys(Options options) : options_(std::move(options)) {}

  // The same endpoint with keys honoured where it takes them. Successes alone are kept: a request that was
  // refused or failed may be tried again under its key. A handler that changes something commits the answer
  // with the change (change.h). Refers to this object.
  http::Endpoint honoured(http::Endpoint endpoint) const;

 private:
  Result<Response> answer(const Request& request, const http::Handler& handler) const;
  // The answer under the request's key, or a refusal if that was another request; absent: none.
  Result<std::optional<Response>> known(const Request& request) const;

  const Options options_;
};

}  // namespace joulecast::api
