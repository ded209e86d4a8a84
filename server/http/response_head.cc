#include "server/http/response_head.h"

#include "server/http/problem.h"

namespace joulecast::http {
namespace {

// Control characters would let a value forge further headers.
void append_header(std::string& head, std::string_view name, std::string_view value) {
  head.append(name).append(": ");
  for (const char c : value) head.push_back(static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? ' ' : c);
  head.append("\r\n");
}

}  // namespace

std::string_view body_of(const Response& response) {
  return response.shared_body ? std::string_view(*response.shared_body) : std::string_view(response.body);
}

void write_head(std::string& head, const Response& response, const HeadContext& context) {
  const unsigned status = response.status;
  const bool bodyless = status == 204 || status == 304;
  head.assign("HTTP/1.1 ").append(std::to_string(status)).append(" ").append(reason_phrase(status));
  head.append("\r\nDate: ").append(context.date).append("\r\n");
  if (!response.content_type.empty() && !bodyless) append_header(head, "Content-Type", response.content_type);
  if (context.chunked) {
    head.append("Transfer-Encoding: chunked\r\n");
  } else if (!response.stream && !bodyless) {
    head.append("Content-Length: ").append(std::to_string(body_of(response).size())).append("\r\n");
  }
  if (!context.keep_alive || context.http_1_0)
    head.append(context.keep_alive ? "Connection: keep-alive\r\n" : "Connection: close\r\n");
  head.append("X-Request-Id: ").append(context.request_id).append("\r\nX-Content-Type-Options: nosniff\r\n");
  if (response.header("Cache-Control").empty()) head.append("Cache-Control: no-store\r\n");
  for (const auto& [name, value] : response.headers) append_header(head, name, value);
  head.append("\r\n");
}

}  // namespace joulecast::http
