#pragma once

// Private to server/http: what a connection and the server share. Everything runs on the I/O thread unless
// stated.
#include "server/http/asio.h"
// asio.h stays first.
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <unordered_map>

#include "server/http/http_server.h"
#include "server/http/worker_pool.h"

namespace joulecast::http {

namespace net = boost::asio;
namespace beast = boost::beast;
using Clock = std::chrono::steady_clock;

// The byte stream of a connection. TLS replaces this alias by ssl::stream and adds its handshake to
// Connection::start() and its shutdown to Connection::close(); nothing else names the socket's type.
using ByteStream = net::ip::tcp::socket;

class Connection;

struct Core {
  Core(const ServerOptions& options_in, const Router& router_in, ServerObserver& observer_in)
      : options(options_in), router(router_in), observer(observer_in) {}

  const ServerOptions options;
  const Router& router;
  ServerObserver& observer;
  net::io_context io{1};
  std::unique_ptr<WorkerPool> workers;
  std::unordered_map<const Connection*, std::shared_ptr<Connection>> connections;
  std::string date;       // value of the Date header, refreshed by the tick
  std::string id_prefix;  // of the request ids of this run
  std::uint64_t next_id = 0;
  bool stopping = false;
  std::stop_source patience;  // ends when the stop's deadline has passed
};

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(std::shared_ptr<Core> core, ByteStream stream);

  void start();
  // Answers 503 without reading and closes: the server is full.
  void turn_away();
  // Enforces the timeouts.
  void tick(Clock::time_point now);
  // The server stops: closes what is idle or endless, lets the rest finish.
  void begin_stop();
  void close();
  // A request is being worked on or its answer sent.
  bool busy() const;

 private:
  enum class Phase : std::uint8_t { idle, reading, handling, writing, streaming, lingering, closed };
  using Parser = beast::http::request_parser<beast::http::string_body>;

  void reset_parser();
  void read();
  void on_read(const boost::system::error_code& error, std::size_t bytes);
  void advance();
  void answer_continue();
  void dispatch();
  void fill_request();
  void refuse(Refusal refusal, unsigned status, std::string_view slug, std::string_view detail);
  void respond();
  void write_head(bool chunked);
  void on_written(const boost::system::error_code& error);
  void finish_exchange();
  void linger();
  void pump();
  void on_pulled(StreamSource::Next next);
  void on_piece_written(const boost::system::error_code& error);
  void woken();
  void drop_stream();
  template <class Done>
  void write(std::array<net::const_buffer, 3> buffers, Done done);

  std::shared_ptr<Core> core_;  // before stream_, which needs the io_context in it
  ByteStream stream_;
  beast::flat_buffer buffer_;
  std::optional<Parser> parser_;
  Phase phase_ = Phase::idle;
  Clock::time_point deadline_{};
  Clock::time_point received_{};
  bool read_pending_ = false;
  bool continue_answered_ = false;
  bool keep_alive_ = true;
  bool refused_ = false;  // the request could not be read: nothing of it may be trusted

  Request request_;
  const Endpoint* endpoint_ = nullptr;
  std::size_t request_bytes_ = 0;
  std::size_t response_bytes_ = 0;

  Response response_;
  std::string head_;

  std::shared_ptr<StreamSource> source_;
  std::string piece_;
  std::string frame_;
  StreamSource::Next next_ = StreamSource::Next::wait;
  bool streamed_ = false;
  bool chunked_ = false;
  bool pulling_ = false;
  bool piece_leaving_ = false;
  bool pull_again_ = false;
  bool end_stream_ = false;
  Clock::time_point pulled_{};
  std::atomic<bool> wake_posted_{false};
};

}  // namespace joulecast::http
