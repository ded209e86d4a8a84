#include "server/http/idempotency.h"

#include <algorithm>
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

std::string location_of(const Response& response) {
  const auto found = std::ranges::find_if(
      response.headers, [](const auto& each) { return equals_ignoring_case(each.first, "Location"); });
  return found == response.headers.end() ? "" : found->second;
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

// Requests that change something are handled one by one (Run::write), so none of the same key runs now.
Result<Response> IdempotencyKeys::answer(const Request& request, const Handler& handler) const {
  Answer now;
  now.key = trim(request.header(idempotency_header));
  if (now.key.empty()) return handler(request);
  if (!is_valid(now.key)) {
    const std::string form =
        "must be at most " + std::to_string(longest_idempotency_key) + " visible ASCII characters";
    return refused(request, form, form);
  }
  now.actor = request.actor;
  now.fingerprint = fingerprint_of(request);
  Result<std::optional<Answer>> before = options_.find(now.actor, now.key);
  if (!before) return tl::unexpected(std::move(before.error()));
  if (*before && (*before)->fingerprint != now.fingerprint)
    return refused(request, "another request was answered under this key",
                   "must be new for each request that is new");
  if (*before) return repeated(std::move(**before));
  Result<Response> response = handler(request);
  if (!response || response->status >= 300 || response->stream) return response;
  now.status = response->status;
  now.location = location_of(*response);
  now.body = response->body;
  options_.keep(std::move(now));
  return response;
}

}  // namespace joulecast::http
