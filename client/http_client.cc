#include "client/http_client.h"

#include <algorithm>
#include <cctype>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
// clang-format off
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
// clang-format on

namespace joulecast::client {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;

constexpr std::uint64_t body_limit_bytes = 256u << 20;

// Beast has no timeouts for blocking calls, so the exchange runs as a chain of asynchronous steps on a loop
// of its own under one deadline.
class Exchange {
 public:
  Exchange(const ServerAddress& server, http::request<http::string_body> request,
           std::chrono::milliseconds timeout)
      : server_(server), request_(std::move(request)), resolver_(loop_), stream_(loop_), timeout_(timeout) {
    parser_.body_limit(body_limit_bytes);
  }

  Result<HttpReply> run() {
    resolver_.async_resolve(server_.host, server_.port, [this](beast::error_code error, const auto& found) {
      if (settle(error, "resolve")) return;
      stream_.expires_after(timeout_);
      stream_.async_connect(found, [this](beast::error_code failed, const tcp::endpoint&) { send(failed); });
    });
    loop_.run_for(timeout_ + std::chrono::milliseconds(200));
    if (!outcome_) return failure("no answer within the timeout");
    return std::move(*outcome_);
  }

 private:
  tl::unexpected<Error> failure(const std::string& why) const {
    return fail(Fault::unavailable, "http://" + server_.host + ":" + server_.port, why);
  }

  bool settle(beast::error_code error, const char* step) {
    if (!error) return false;
    outcome_ = failure(std::string("cannot ") + step + ": " + error.message());
    return true;
  }

  void send(beast::error_code error) {
    if (settle(error, "connect")) return;
    http::async_write(stream_, request_, [this](beast::error_code failed, std::size_t) { receive(failed); });
  }

  void receive(beast::error_code error) {
    if (settle(error, "send")) return;
    http::async_read(stream_, buffer_, parser_, [this](beast::error_code failed, std::size_t) {
      if (settle(failed, "receive")) return;
      auto message = parser_.release();
      HttpReply reply;
      reply.status = message.result_int();
      reply.content_type = std::string(message[http::field::content_type]);
      reply.body = std::move(message.body());
      outcome_ = std::move(reply);
      beast::error_code ignored;
      stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
    });
  }

  ServerAddress server_;
  http::request<http::string_body> request_;
  asio::io_context loop_{1};
  tcp::resolver resolver_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  http::response_parser<http::string_body> parser_;
  std::chrono::milliseconds timeout_;
  std::optional<Result<HttpReply>> outcome_;
};

}  // namespace

Result<ServerAddress> parse_server_url(std::string_view url) {
  constexpr std::string_view scheme = "http://";
  const std::string given(url);
  if (!url.starts_with(scheme)) return invalid("server", given + " must begin with http://");
  url.remove_prefix(scheme.size());
  const std::size_t slash = std::min(url.find('/'), url.size());
  std::string_view authority = url.substr(0, slash);
  std::string_view path = url.substr(slash);
  while (path.ends_with('/')) path.remove_suffix(1);
  ServerAddress address{{}, "80", std::string(path)};
  // A colon inside brackets belongs to an IPv6 address.
  const std::size_t bracket = authority.rfind(']');
  const std::size_t colon = authority.rfind(':');
  if (colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket)) {
    address.port = std::string(authority.substr(colon + 1));
    authority = authority.substr(0, colon);
    const bool digits = std::all_of(address.port.begin(), address.port.end(),
                                    [](unsigned char c) { return std::isdigit(c) != 0; });
    if (address.port.empty() || address.port.size() > 5 || !digits || std::stoi(address.port) > 65535) {
      return invalid("server", given + " has no valid port");
    }
  }
  if (authority.starts_with('[') && authority.ends_with(']'))
    authority = authority.substr(1, authority.size() - 2);
  if (authority.empty()) return invalid("server", given + " names no host");
  address.host = std::string(authority);
  return address;
}

Result<HttpReply> http_request(const ServerAddress& server, HttpMethod method, std::string_view target,
                               std::string json_body, std::chrono::milliseconds timeout) {
  const http::verb verb = method == HttpMethod::get    ? http::verb::get
                          : method == HttpMethod::post ? http::verb::post
                                                       : http::verb::put;
  http::request<http::string_body> request(verb, server.base_path + std::string(target), 11);
  const bool bracketed = server.host.find(':') != std::string::npos;
  request.set(http::field::host, (bracketed ? "[" + server.host + "]" : server.host) + ":" + server.port);
  request.set(http::field::user_agent, "joulecast/" JOULECAST_VERSION);
  request.set(http::field::accept, "application/json, application/problem+json");
  request.keep_alive(false);
  if (method != HttpMethod::get) {
    request.set(http::field::content_type, "application/json");
    request.body() = std::move(json_body);
  }
  request.prepare_payload();
  return Exchange(server, std::move(request), timeout).run();
}

Error error_of(const HttpReply& reply) {
  Fault fault = Fault::unavailable;
  if (reply.status == 404) {
    fault = Fault::not_found;
  } else if (reply.status == 409 || reply.status == 412) {
    fault = Fault::conflict;
  } else if (reply.status == 413) {
    fault = Fault::too_large;
  } else if (reply.status >= 400 && reply.status < 500 && reply.status != 429) {
    fault = Fault::invalid;
  }
  std::string message = "the server answered " + std::to_string(reply.status);
  const auto problem = nlohmann::json::parse(reply.body, nullptr, false);
  if (problem.is_object()) {
    for (const char* key : {"title", "detail"}) {
      if (const auto at = problem.find(key); at != problem.end() && at->is_string()) {
        message += ": " + at->get<std::string>();
      }
    }
  }
  return {fault, {}, message};
}

}  // namespace joulecast::client
