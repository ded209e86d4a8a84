// exchange() of http_client.h on Beast, which appears in no other file of this room.
// <utility> comes first: Boost 1.74's awaitable.hpp uses std::exchange without including it.
#include <utility>
// clang-format off
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
// clang-format on

#include "http_client/http_client.h"

namespace joulecast::http_client {
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
           ClientCertificate certificate, bool status_only, std::chrono::milliseconds timeout)
      : server_(server),
        request_(std::move(request)),
        certificate_(std::move(certificate)),
        status_only_(status_only),
        resolver_(loop_),
        stream_(loop_),
        timeout_(timeout) {
    parser_.body_limit(body_limit_bytes);
  }

  Result<HttpReply> run() {
    if (server_.tls && !prepare_tls()) return std::move(*outcome_);
    resolver_.async_resolve(server_.host, server_.port, [this](beast::error_code error, const auto& found) {
      if (settle(error, "find the host")) return;
      stream_.expires_after(timeout_);
      stream_.async_connect(found,
                            [this](beast::error_code failed, const tcp::endpoint&) { shake_hands(failed); });
    });
    loop_.run_for(timeout_ + std::chrono::milliseconds(200));
    if (!outcome_) return failure("no answer within the timeout");
    return std::move(*outcome_);
  }

 private:
  tl::unexpected<Error> failure(const std::string& why) const {
    return fail(Fault::unavailable,
                (server_.tls ? "https://" : "http://") + server_.host + ":" + server_.port, why);
  }

  bool settle(beast::error_code error, const char* step, const char* hint = "") {
    if (!error) return false;
    outcome_ = failure(std::string("cannot ") + step + ": " + error.message() + hint);
    return true;
  }

  // Trusts the system's authorities, or those that SSL_CERT_FILE or SSL_CERT_DIR name.
  bool prepare_tls() {
    beast::error_code error;
    trust_.set_default_verify_paths(error);
    if (settle(error, "read the trusted certificates")) return false;
    if (!certificate_.file.empty()) trust_.use_certificate_chain_file(certificate_.file, error);
    if (settle(error, "use the client's certificate")) return false;
    if (!certificate_.key_file.empty())
      trust_.use_private_key_file(certificate_.key_file, asio::ssl::context::pem, error);
    if (settle(error, "use the key of the client's certificate")) return false;
    tls_.emplace(stream_, trust_);
    tls_->set_verify_mode(asio::ssl::verify_peer);
    tls_->set_verify_callback(asio::ssl::host_name_verification(server_.host));
    beast::error_code no_address;
    asio::ip::make_address(server_.host, no_address);
    if (no_address && SSL_set_tlsext_host_name(tls_->native_handle(), server_.host.c_str()) != 1) {
      outcome_ = failure("is no name of a host");
      return false;
    }
    return true;
  }

  void shake_hands(beast::error_code error) {
    if (settle(error, "connect", "; is joulecastd running there?")) return;
    if (!tls_) return send();
    tls_->async_handshake(asio::ssl::stream_base::client, [this](beast::error_code failed) {
      if (!settle(failed, "agree on TLS", "; SSL_CERT_FILE names the certificates to trust")) send();
    });
  }

  template <class Use>
  void with_stream(Use use) {
    if (tls_) return use(*tls_);
    use(stream_);
  }

  void send() {
    with_stream([this](auto& stream) {
      http::async_write(stream, request_, [this](beast::error_code failed, std::size_t) {
        if (!settle(failed, "send")) receive();
      });
    });
  }

  void receive() {
    with_stream([this](auto& stream) {
      const auto received = [this](beast::error_code failed, std::size_t) {
        if (!settle(failed, "receive", tls_ ? "" : "; does the port want https?")) finish();
      };
      if (status_only_)
        http::async_read_header(stream, buffer_, parser_, received);
      else
        http::async_read(stream, buffer_, parser_, received);
    });
  }

  void finish() {
    auto message = parser_.release();
    HttpReply reply;
    reply.status = message.result_int();
    reply.content_type = std::string(message[http::field::content_type]);
    reply.link = std::string(message[http::field::link]);
    reply.body = std::move(message.body());
    outcome_ = std::move(reply);
    beast::error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
  }

  ServerAddress server_;
  http::request<http::string_body> request_;
  const ClientCertificate certificate_;
  const bool status_only_;
  asio::io_context loop_{1};
  tcp::resolver resolver_;
  asio::ssl::context trust_{asio::ssl::context::tls_client};
  beast::tcp_stream stream_;
  std::optional<asio::ssl::stream<beast::tcp_stream&>> tls_;  // over stream_, for https
  beast::flat_buffer buffer_;
  http::response_parser<http::string_body> parser_;
  std::chrono::milliseconds timeout_;
  std::optional<Result<HttpReply>> outcome_;
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
  return Exchange(server, std::move(request), wanted.certificate, wanted.status_only, timeout).run();
}

}  // namespace joulecast::http_client
