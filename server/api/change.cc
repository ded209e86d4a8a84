#include "server/api/change.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "access/sha256.h"
#include "base/try.h"
#include "server/http/gate.h"
#include "server/http/problem.h"
#include "server/http/text.h"

namespace joulecast::api {
namespace {

bool is_valid(std::string_view key) {
  const auto visible = [](char c) { return c > 0x20 && c < 0x7f; };
  return key.size() <= http::longest_idempotency_key && std::ranges::all_of(key, visible);
}

std::string fingerprint_of(const Request& request) {
  std::string text(http::to_string(request.method));
  text.append(" ").append(request.target).append("\n").append(request.body);
  return access::sha256_hex(text);
}

Response refused(const Request& request, const std::string& detail, const std::string& constraint) {
  const std::string header(http::idempotency_header);
  return http::problem(422, "invalid", header + ": " + detail, request.id, header, constraint);
}

Response repeated(history::RequestAnswer&& answer) {
  Response response = http::json_response(std::move(answer.body));
  response.status = static_cast<unsigned>(answer.status);
  if (!answer.location.empty()) response.headers.emplace_back("Location", std::move(answer.location));
  response.headers.emplace_back("Idempotency-Replayed", "true");
  return response;
}

history::RequestAnswer answer_under(history::RequestAnswer key, const Response& response) {
  key.status = response.status;
  key.location = response.header("Location");
  key.body = response.body;
  return key;
}

// Without a time.
history::RequestAnswer key_of(const Request& request) {
  return {request.actor, request.kept.idempotency_key, request.kept.fingerprint, 0, 0, "", ""};
}

}  // namespace

history::Change RequestChange::answered_by(Answer answer, std::optional<history::Command> command) {
  response_ = std::make_shared<std::optional<Response>>();
  const std::int64_t now = services_.now_utime_us();
  const http::Kept& kept = request_.kept;
  history::Change change;
  change.command = std::move(command);
  if (!kept.idempotency_key.empty()) {
    change.key = key_of(request_);
    change.key->utime_us = now;
  }
  history::AuditEntry entry{0, now, request_.actor, request_.address, request_.id, kept.audit_action, {}, {}};
  change.follow = [response = response_, answer = std::move(answer), key = change.key,
                   entry = std::move(entry)](std::int64_t outcome) mutable {
    *response = answer(outcome);
    std::vector<history::Command> commands;
    if (!entry.action.empty()) {
      entry.detail_json = http::audited_status((*response)->status);
      commands.emplace_back(history::AppendAudit{entry});
    }
    if (key) commands.emplace_back(history::KeepAnswer{answer_under(*key, **response)});
    return commands;
  };
  return change;
}

Result<Response> RequestChange::execute(history::Command command, std::string text) {
  return result(services_.writer.execute(answered_by(
      [text = std::move(text)](std::int64_t) { return http::json_response(text); }, std::move(command))));
}

Result<Response> RequestChange::finish(Result<void> committed) {
  if (!committed) {
    Error& why = committed.error();
    if (why.field == history::Change::key_field) why.field = http::idempotency_header;
    return tl::unexpected(std::move(why));
  }
  request_.kept.committed = true;
  return std::move(**response_);
}

http::Endpoint IdempotencyKeys::honoured(http::Endpoint endpoint) const {
  if (http::takes_idempotency_key(endpoint))
    endpoint.handler = [this, handler = std::move(endpoint.handler)](const Request& request) {
      return answer(request, handler);
    };
  return endpoint;
}

Result<std::optional<Response>> IdempotencyKeys::known(const Request& request) const {
  TRY_ASSIGN(auto before, options_.find(request.actor, request.kept.idempotency_key));
  if (!before) return std::nullopt;
  if (before->fingerprint == request.kept.fingerprint) return repeated(std::move(*before));
  return refused(request, "another request was answered under this key",
                 "must be new for each request that is new");
}

// Changing requests are handled one by one (Run::write): another one of the same key is another daemon's.
Result<Response> IdempotencyKeys::answer(const Request& request, const http::Handler& handler) const {
  request.kept.idempotency_key = trimmed(request.header(http::idempotency_header));
  if (request.kept.idempotency_key.empty()) return handler(request);
  if (!is_valid(request.kept.idempotency_key)) {
    const std::string form =
        "must be at most " + std::to_string(http::longest_idempotency_key) + " visible ASCII characters";
    return refused(request, form, form);
  }
  request.kept.fingerprint = fingerprint_of(request);
  const auto until = std::chrono::steady_clock::now() + options_.wait;
  for (;;) {
    Result<std::optional<Response>> before = known(request);
    if (!before) return tl::unexpected(std::move(before.error()));
    if (*before) return std::move(**before);
    Result<Response> response = handler(request);
    if (response && response->status < 300 && !response->stream) {
      if (!request.kept.committed) options_.keep(answer_under(key_of(request), *response));
      return response;
    }
    const bool handled_elsewhere = !response && response.error().field == http::idempotency_header;
    if (!handled_elsewhere) {
      // What refuses the change may be the same change, done by another daemon since.
      before = known(request);
      return before && *before ? Result<Response>(std::move(**before)) : response;
    }
    if (std::chrono::steady_clock::now() >= until || request.stop.stop_requested()) return response;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace joulecast::api
