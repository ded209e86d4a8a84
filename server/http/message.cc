#include "server/http/message.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <charconv>
#include <cstdlib>

#include "server/http/text.h"

namespace joulecast::http {

std::string_view to_string(Method method) {
  switch (method) {
    case Method::get:
      return "GET";
    case Method::head:
      return "HEAD";
    case Method::post:
      return "POST";
    case Method::put:
      return "PUT";
    case Method::patch:
      return "PATCH";
    case Method::del:
      return "DELETE";
    case Method::options:
      return "OPTIONS";
    case Method::other:
      break;
  }
  return "OTHER";
}

const std::string& Request::param(std::string_view name) const {
  for (const auto& [key, value] : path_params) {
    if (key == name) return value;
  }
  std::abort();  // the template of this endpoint has no such parameter: our bug
}

std::optional<std::string_view> Request::query_value(std::string_view name) const {
  for (const auto& [key, value] : query) {
    if (key == name) return value;
  }
  return std::nullopt;
}

std::optional<double> Request::query_number(std::string_view name) const {
  const auto text = query_value(name);
  return text ? parse_number<double>(*text) : std::nullopt;
}

std::optional<std::int64_t> Request::query_integer(std::string_view name) const {
  const auto text = query_value(name);
  return text ? parse_number<std::int64_t>(*text) : std::nullopt;
}

std::optional<bool> Request::query_boolean(std::string_view name) const {
  const auto text = query_value(name);
  if (!text) return std::nullopt;
  return *text == "true";
}

std::string_view Request::header(std::string_view name) const {
  for (const auto& [key, value] : headers) {
    if (equals_ignoring_case(key, name)) return value;
  }
  return {};
}

Response json_response(std::string body) {
  Response response;
  response.body = std::move(body);
  return response;
}

namespace {

class Generator : public StreamSource {
 public:
  explicit Generator(std::function<bool(std::string&, const std::stop_token&)> next)
      : next_(std::move(next)) {}
  Next pull(std::string& out) override {
    if (left_.stop_requested()) return Next::abort;
    try {
      return next_(out, left_.get_token()) ? Next::more : Next::end;
    } catch (...) {
      // The head has been sent with status 200; only a broken connection can indicate the error to the
      // client.
      return Next::abort;
    }
  }
  void cancel() override { left_.request_stop(); }

 private:
  std::function<bool(std::string&, const std::stop_token&)> next_;
  std::stop_source left_;
};

}  // namespace

std::shared_ptr<StreamSource> generate(
    std::function<bool(std::string& out, const std::stop_token& left)> next) {
  return std::make_shared<Generator>(std::move(next));
}

}  // namespace joulecast::http
