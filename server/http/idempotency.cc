#include "server/http/idempotency.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "access/sha256.h"
#include "server/http/problem.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

bool is_valid(std::string_view key) {
  const auto visible = [](char c) { return c > 0x20 && c < 0x7f; };
  return key.size() <= longest_idempotency_key && std::ranges::all_of(key, visible);
}

std::string fingerprint_of(const Request& request) {
  std::string text(to_string(request.method));
  text.append(" ").append(request.target).append("\n").append(request.body);
  return access::sha256_hex(text);
}

Response refused(const Request& request, const std::string& detail, const std::string& constraint) {
  const std::string header(idempotency_header);
  return problem(422, "invalid", header + ": " + detail, request.id, header, constraint);
}

Response repeated(IdempotencyKeys::Answer&& answer) {
  Response response = json_response(std::move(answer.body));
  response.status = answer.status;
  if (!answer.location.empty()) response.headers.emplace_back("Location", std::move(answer.location));
  response.headers.emplace_back("Idempotency-Replayed", "true");
  return response;
}

}  // namespace

std::string location_of(const Response& response) {
  const auto found = std::ranges::find_if(
      response.headers, [](const auto& each) { return equals_ignoring_case(each.first, "Location"); });
  return found == response.headers.end() ? "" : found->second;
}

IdempotencyKeys::Answer answer_of(const Request& request, const Response& response) {
  return {request.actor,   request.kept.idempotency_key, request.kept.fingerprint,
          response.status, location_of(response),        response.body};
}

bool takes_idempotency_key(const Endpoint& endpoint) {
  return endpoint.method != Method::get && (endpoint.role == Role::operate || endpoint.role == Role::admin);
}

Endpoint IdempotencyKeys::honoured(Endpoint endpoint) const {
  if (takes_idempotency_key(endpoint))
    endpoint.handler = [this, handler = std::move(endpoint.handler)](const Request& request) {
      return answer(request, handler);
    };
  return endpoint;
}

Result<std::optional<Response>> IdempotencyKeys::known(const Request& request) const {
  Result<std::optional<Answer>> before = options_.find(request.actor, request.kept.idempotency_key);
  if (!before) return tl::unexpected(std::move(before.error()));
  if (!*before) return std::nullopt;
  if ((*before)->fingerprint == request.kept.fingerprint) return repeated(std::move(**before));
  return refused(request, "another request was answered under this key",
                 "must be new for each request that is new");
}

// Requests that change something are handled one by one (Run::write), so that another one of the same key can
// only be another daemon's.
Result<Response> IdempotencyKeys::answer(const Request& request, const Handler& handler) const {
  request.kept.idempotency_key = trim(request.header(idempotency_header));
  if (request.kept.idempotency_key.empty()) return handler(request);
  if (!is_valid(request.kept.idempotency_key)) {
    const std::string form =
        "must be at most " + std::to_string(longest_idempotency_key) + " visible ASCII characters";
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
      if (!request.kept.committed) options_.keep(answer_of(request, *response));
      return response;
    }
    const bool handled_elsewhere = !response && response.error().field == idempotency_header;
    if (!handled_elsewhere) {
      // What refuses the change may be the same change, done by another daemon since.
      before = known(request);
      return before && *before ? Result<Response>(std::move(**before)) : response;
    }
    if (std::chrono::steady_clock::now() >= until || request.stop.stop_requested()) return response;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace joulecast::http
