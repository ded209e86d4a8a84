#include "server/http/message.h"

#include <algorithm>
#include <cstdlib>

#include "server/http/text.h"

namespace joulecast::http {

std::string_view to_string(Method method) {
  static constexpr std::string_view names[] = {"GET",   "HEAD",   "POST",    "PUT",
                                               "PATCH", "DELETE", "OPTIONS", "OTHER"};
  return names[static_cast<std::size_t>(method)];
}

namespace {

// Of a list of names and values, the first that is called so; null: none.
template <class List, class Same>
auto value_in(const List& list, std::string_view name, Same same) -> decltype(&list.front().second) {
  const auto found = std::ranges::find_if(list, [&](const auto& each) { return same(each.first, name); });
  return found != list.end() ? &found->second : nullptr;
}

class Generator : public StreamSource {
 public:
  explicit Generator(std::function<bool(std::string&, const std::stop_token&)> next)
      : next_(std::move(next)) {}
  Next pull(std::string& out) override {
    if (left_.stop_requested()) return Next::abort;
    try {
      return next_(out, left_.get_token()) ? Next::more : Next::end;
    } catch (...) {
      // The head has been sent with status 200; only a broken connection can indicate the error.
      return Next::abort;
    }
  }
  void cancel() override { left_.request_stop(); }

 private:
  std::function<bool(std::string&, const std::stop_token&)> next_;
  std::stop_source left_;
};

}  // namespace

const std::string& Request::param(std::string_view name) const {
  if (const auto* value = value_in(path_params, name, std::equal_to<>())) return *value;
  std::abort();  // the template of this endpoint has no such parameter: our bug
}

std::optional<std::string_view> Request::query_value(std::string_view name) const {
  const auto* value = value_in(query, name, std::equal_to<>());
  return value != nullptr ? std::optional<std::string_view>(*value) : std::nullopt;
}

std::optional<double> Request::query_number(std::string_view name) const {
  const auto text = query_value(name);
  return text ? to_number<double>(*text) : std::nullopt;
}

std::optional<std::int64_t> Request::query_integer(std::string_view name) const {
  const auto text = query_value(name);
  return text ? to_number<std::int64_t>(*text) : std::nullopt;
}

std::optional<bool> Request::query_boolean(std::string_view name) const {
  const auto text = query_value(name);
  if (!text) return std::nullopt;
  return *text == "true";
}

std::string_view Request::header(std::string_view name) const {
  const auto* value = value_in(headers, name, equals_ignoring_case);
  return value != nullptr ? *value : std::string_view();
}

std::string_view Response::header(std::string_view name) const {
  const auto* value = value_in(headers, name, equals_ignoring_case);
  return value != nullptr ? std::string_view(*value) : std::string_view();
}

std::string_view body_of(const Response& response) {
  return response.shared_body ? std::string_view(*response.shared_body) : std::string_view(response.body);
}

Response json_response(std::string body) {
  Response response;
  response.body = std::move(body);
  return response;
}

std::shared_ptr<StreamSource> generate(
    std::function<bool(std::string& out, const std::stop_token& left)> next) {
  return std::make_shared<Generator>(std::move(next));
}

}  // namespace joulecast::http
