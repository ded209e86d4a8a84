// <utility> comes first: Boost 1.74's awaitable.hpp uses std::exchange without including it.
// clang-format off
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <algorithm>
#include <cctype>
#include <optional>
// clang-format on

#include "http_client/http_client.h"

namespace joulecast::http_client {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;

constexpr std::uint64_t body_limit_bytes = 256u << 20;

template <class T>
using Task = asio::awaitable<T>;

// One exchange: a coroutine on a loop of its own under one deadline, as Beast's blocking calls have none.
class Exchange {
 public:
  Exchange(const ServerAddress& server, const HttpRequest& wanted, std::chrono::milliseconds timeout)
      : server_(server), wanted_(wanted), timeout_(timeout) {}

  Result<HttpReply> run(const http::request<http::string_body>& request) {
    Result<HttpReply> outcome = failure("no answer within the timeout");
    asio::co_spawn(loop_, talk(request), [&outcome](std::exception_ptr thrown, Result<HttpReply> reply) {
      if (thrown) std::rethrow_exception(std::move(thrown));
      outcome = std::move(reply);
    });
    loop_.run_for(timeout_ + std::chrono::milliseconds(200));
    return outcome;
  }

 private:
  tl::unexpected<Error> failure(const std::string& why) const {
    return fail(Fault::unavailable,
                (server_.tls ? "https://" : "http://") + server_.host + ":" + server_.port, why);
  }

  auto step() { return asio::redirect_error(asio::use_awaitable, error_); }

  // The fault of the last step.
  tl::unexpected<Error> cannot(const std::string& what, const char* hint = "") const {
    return failure("cannot " + what + ": " + error_.message() + hint);
  }

  Task<Result<HttpReply>> talk(const http::request<http::string_body>& request) {
    if (server_.tls)
      if (auto prepared = prepare_tls(); !prepared) co_return tl::unexpected(std::move(prepared.error()));
    tcp::resolver resolver(loop_);
    const auto found = co_await resolver.async_resolve(server_.host, server_.port, step());
    if (error_) co_return cannot("find the host");
    stream_.expires_after(timeout_);
    co_await stream_.async_connect(found, step());
    if (error_) co_return cannot("connect", "; is joulecastd running there?");
    if (!tls_) co_return co_await ask(stream_, request);
    co_await tls_->async_handshake(asio::ssl::stream_base::client, step());
    if (error_) co_return cannot("agree on TLS", "; SSL_CERT_FILE names the certificates to trust");
    co_return co_await ask(*tls_, request);
  }

  // Trusts the system's authorities, or those that SSL_CERT_FILE or SSL_CERT_DIR name.
  Result<void> prepare_tls() {
    trust_.set_default_verify_paths(error_);
    if (error_) return cannot("read the trusted certificates");
    const auto& [file, key_file] = wanted_.certificate;
    if (!file.empty()) trust_.use_certificate_chain_file(file, error_);
    if (error_) return cannot("use the client's certificate");
    if (!key_file.empty()) trust_.use_private_key_file(key_file, asio::ssl::context::pem, error_);
    if (error_) return cannot("use the key of the client's certificate");
    tls_.emplace(stream_, trust_);
    tls_->set_verify_mode(asio::ssl::verify_peer);
    tls_->set_verify_callback(asio::ssl::host_name_verification(server_.host));
    beast::error_code no_address;
    asio::ip::make_address(server_.host, no_address);
    if (no_address && SSL_set_tlsext_host_name(tls_->native_handle(), server_.host.c_str()) != 1)
      return failure("is no name of a host");
    return {};
  }

  template <class Stream>
  Task<Result<HttpReply>> ask(Stream& stream, const http::request<http::string_body>& request) {
    co_await http::async_write(stream, request, step());
    if (error_) co_return cannot("send");
    beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    parser.body_limit(body_limit_bytes);
    if (wanted_.status_only)
      co_await http::async_read_header(stream, buffer, parser, step());
    else
      co_await http::async_read(stream, buffer, parser, step());
    if (error_) co_return cannot("receive", tls_ ? "" : "; does the port want https?");
    beast::error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
    auto message = parser.release();
    co_return HttpReply{message.result_int(), std::string(message[http::field::content_type]),
                        std::move(message.body()), std::string(message[http::field::link])};
  }

  const ServerAddress& server_;
  const HttpRequest& wanted_;
  const std::chrono::milliseconds timeout_;
  beast::error_code error_;  // of the last step
  asio::io_context loop_{1};
  asio::ssl::context trust_{asio::ssl::context::tls_client};
  beast::tcp_stream stream_{loop_};
  std::optional<asio::ssl::stream<beast::tcp_stream&>> tls_;  // over stream_, for https
};

}  // namespace

Result<HttpReply> exchange(const ServerAddress& server, const HttpRequest& wanted,
                           std::chrono::milliseconds timeout) {
  const HttpMethod method = wanted.method;
  const http::verb verb = method == HttpMethod::get    ? http::verb::get
                          : method == HttpMethod::post ? http::verb::post
                          : method == HttpMethod::put  ? http::verb::put
                                                       : http::verb::delete_;
  http::request<http::string_body> request(verb, server.base_path + wanted.target, 11);
  const bool bracketed = server.host.find(':') != std::string::npos;
  request.set(http::field::host, (bracketed ? "[" + server.host + "]" : server.host) + ":" + server.port);
  request.set(http::field::user_agent, "joulecast/" JOULECAST_VERSION);
  for (const auto& [name, value] : wanted.headers) request.set(name, value);
  request.keep_alive(false);
  if (method != HttpMethod::get && method != HttpMethod::del) {
    request.set(http::field::content_type, "application/json");
    request.body() = wanted.json_body;
  }
  request.prepare_payload();
  return Exchange(server, wanted, timeout).run(request);
}

Result<ServerAddress> parse_url(std::string_view url, const std::string& field) {
  const bool tls = url.starts_with("https://");
  if (tls || url.starts_with("http://")) {
    url.remove_prefix(tls ? 8 : 7);
  } else if (url.find("://") != std::string_view::npos) {
    return invalid(field, "must begin with http:// or https://");
  }
  const std::size_t slash = std::min(url.find_first_of("/?#"), url.size());
  std::string_view authority = url.substr(0, slash);
  std::string_view path = url.substr(slash);
  if (path.starts_with('?') || path.starts_with('#')) return invalid(field, "must have a path before that");
  while (path.find('?') == std::string_view::npos && path.ends_with('/')) path.remove_suffix(1);
  ServerAddress address{{}, tls ? "443" : "80", std::string(path), tls};
  if (authority.find('@') != std::string_view::npos)
    return invalid(field, "must have no user name or password");
  // A colon inside brackets belongs to an IPv6 address.
  const std::size_t bracket = authority.rfind(']');
  const std::size_t colon = authority.rfind(':');
  if (colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket)) {
    address.port = std::string(authority.substr(colon + 1));
    authority = authority.substr(0, colon);
    const bool digits = std::all_of(address.port.begin(), address.port.end(),
                                    [](unsigned char c) { return std::isdigit(c) != 0; });
    if (address.port.empty() || address.port.size() > 5 || !digits || std::stoi(address.port) > 65535)
      return invalid(field, "has no valid port");
  }
  if (authority.starts_with('[') && authority.ends_with(']'))
    authority = authority.substr(1, authority.size() - 2);
  if (authority.empty()) return invalid(field, "names no host");
  address.host = std::string(authority);
  return address;
}

}  // namespace joulecast::http_client
