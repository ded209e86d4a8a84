#include "server/http/delivery.h"

#include <fmt/format.h>

#include <utility>

#include "server/http/content_coding.h"
#include "server/http/json_digits.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

constexpr std::size_t least_coded_bytes = 1024;

bool is_json(const Response& response) {
  return response.content_type.starts_with("application/json");
}

std::string& own_body(Response& response) {
  if (response.shared_body) response.body = *std::exchange(response.shared_body, nullptr);
  return response.body;
}

void round(const Request& request, Response& response) {
  const auto digits = static_cast<int>(request.query_integer("digits").value_or(usual_digits));
  if (digits < all_digits) round_numbers(own_body(response), digits);
}

// True when the client has it.
bool tag(const Request& request, Response& response) {
  const std::string made = entity_tag(body_of(response));
  response.headers.emplace_back("ETag", made);
  response.headers.emplace_back("Cache-Control", "private, no-cache");
  if (!lists(request.header("if-none-match"), std::string_view(made).substr(2))) return false;
  response.status = 304;
  own_body(response).clear();
  return true;
}

void code(const Request& request, Response& response) {
  const Coding coding = coding_of(request.header("accept-encoding"));
  if (coding == Coding::identity) return;
  if (response.stream) {
    response.stream = coded(coding, std::move(response.stream));
  } else {
    std::string smaller = coded(coding, body_of(response));
    if (smaller.empty() || smaller.size() >= body_of(response).size()) return;
    own_body(response) = std::move(smaller);
  }
  response.headers.emplace_back("Content-Encoding", name(coding));
}

}  // namespace

std::string entity_tag(std::string_view bytes) {
  return fmt::format("W/\"{:x}\"", fnv1a(bytes));
}

void deliver(const Endpoint& endpoint, const Request& request, Response& response, bool on_io) {
  if (response.status != endpoint.success_status || !response.header("Content-Encoding").empty()) return;
  std::string vary = endpoint.csv ? "Accept" : "";
  if (endpoint.rounded && is_json(response) && !response.stream) round(request, response);
  const bool known = endpoint.etag && !response.stream && tag(request, response);
  const bool large = response.stream || body_of(response).size() >= least_coded_bytes;
  if (!on_io && endpoint.response_type != "text/event-stream" && large) {
    vary += vary.empty() ? "Accept-Encoding" : ", Accept-Encoding";
    if (!known) code(request, response);
  }
  if (!vary.empty()) response.headers.emplace_back("Vary", std::move(vary));
}

Asset::Asset(std::string bytes, std::string content_type, std::string cache_control)
    : content_type_(std::move(content_type)), cache_control_(std::move(cache_control)) {
  plain_tag_ = entity_tag(bytes).substr(2);  // one form, one tag: strong
  gzipped_tag_ = plain_tag_;
  gzipped_tag_.insert(gzipped_tag_.size() - 1, "-gzip");
  std::string small = gzip_smallest(bytes);
  if (!small.empty() && small.size() < bytes.size())
    gzipped_ = std::make_shared<const std::string>(std::move(small));
  plain_ = std::make_shared<const std::string>(std::move(bytes));
}

Response Asset::answer(const Request& request) const {
  const bool compressed = gzipped_ && lists(request.header("accept-encoding"), "gzip");
  const std::string& tag = compressed ? gzipped_tag_ : plain_tag_;
  Response response;
  response.content_type = content_type_;
  response.headers = {{"ETag", tag}, {"Cache-Control", cache_control_}, {"Vary", "Accept-Encoding"}};
  if (lists(request.header("if-none-match"), tag)) {
    response.status = 304;
    return response;
  }
  if (compressed) response.headers.emplace_back("Content-Encoding", "gzip");
  response.shared_body = compressed ? gzipped_ : plain_;
  return response;
}

}  // namespace joulecast::http
