#include "tests/benchmarks/bare_server.h"

#include "server/http/asio.h"
// asio.h stays first of Boost.
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <thread>
#include <utility>

namespace joulecast::benchmarks {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;

class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(net::ip::tcp::socket socket, const std::string& body) : stream_(std::move(socket)), body_(body) {}
  void read() {
    request_ = {};
    beast::http::async_read(stream_, buffer_, request_, [self = shared_from_this()](auto error, std::size_t) {
      if (!error) self->write();
    });
  }

 private:
  void write() {
    response_ = {beast::http::status::ok, request_.version()};
    response_.set(beast::http::field::content_type, "application/json");
    response_.body() = body_;
    response_.keep_alive(request_.keep_alive());
    response_.prepare_payload();
    beast::http::async_write(stream_, response_, [self = shared_from_this()](auto error, std::size_t) {
      if (!error) self->read();
    });
  }

  beast::tcp_stream stream_;
  const std::string& body_;
  beast::flat_buffer buffer_;
  beast::http::request<beast::http::string_body> request_;
  beast::http::response<beast::http::string_body> response_;
};

}  // namespace

struct BareServer::Impl {
  explicit Impl(std::string text)
      : body(std::move(text)), acceptor(io, {net::ip::make_address("127.0.0.1"), 0}) {
    accept();
    thread = std::thread([this] { io.run(); });
  }
  ~Impl() {
    io.stop();
    thread.join();
  }
  void accept() {
    acceptor.async_accept([this](auto error, net::ip::tcp::socket socket) {
      if (error) return;
      socket.set_option(net::ip::tcp::no_delay(true));
      std::make_shared<Session>(std::move(socket), body)->read();
      accept();
    });
  }

  std::string body;
  net::io_context io{1};
  net::ip::tcp::acceptor acceptor;
  std::thread thread;
};

BareServer::BareServer(std::string body) : impl_(std::make_unique<Impl>(std::move(body))) {}
BareServer::~BareServer() = default;
std::uint16_t BareServer::port() const {
  return impl_->acceptor.local_endpoint().port();
}

}  // namespace joulecast::benchmarks
