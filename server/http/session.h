#pragma once

// Private to server/http: state shared by sessions and the server. All runs on the I/O thread unless stated.
#include "server/http/asio.h"
// asio.h stays first.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_set>

#include "server/http/admission.h"
#include "server/http/delivery.h"
#include "server/http/http_server.h"

namespace boost::asio::ssl {
class context;
}

namespace joulecast::http {

namespace net = boost::asio;
namespace beast = boost::beast;
using Clock = std::chrono::steady_clock;
using Tcp = net::ip::tcp;
using Executor = net::io_context::executor_type;
using Socket = net::basic_stream_socket<Tcp, Executor>;
using Timer = net::basic_waitable_timer<Clock, net::wait_traits<Clock>, Executor>;
template <class T>
using Task = net::awaitable<T, Executor>;
inline constexpr net::use_awaitable_t<Executor> use_task;
inline constexpr Clock::time_point never = Clock::time_point::max();

class Session;

// A client, with the server's resources that it holds.
struct Peer {
  std::string name;  // its address or network, or "token " and the token's name
  std::size_t connections = 0;
  std::size_t requests = 0;        // waiting or computing
  std::uint64_t bodies_bytes = 0;  // of requests not yet answered
};

// The other end of a connection. A guest came when all places were taken: it is answered one request, and
// only of a `reserved` endpoint.
struct Caller {
  net::ip::address address;
  std::shared_ptr<Peer> peer;
  bool guest = false;
};

// A few threads and a bounded queue. Tasks must not throw.
class WorkerPool {
 public:
  WorkerPool(unsigned threads, std::size_t capacity) : capacity_(capacity), threads_(std::max(threads, 1U)) {}
  ~WorkerPool() { threads_.join(); }  // runs queued tasks first

  // False when the queue is full; `admitted`, the next piece of begun work, is never refused. Any thread.
  bool submit(std::function<void()> task, bool admitted = false);

 private:
  const std::size_t capacity_;
  std::atomic<std::size_t> waiting_{0};
  net::thread_pool threads_;
};

struct Core {
  Core(const ServerOptions& options_in, const Router& router_in, ServerObserver& observer_in)
      : options(options_in),
        router(router_in),
        observer(observer_in),
        cors(options.allowed_origins),
        admission(options.allowed_hosts, cors) {}

  // The peer that the limits per client apply to: a client with one IPv6 address commonly has its whole /64.
  std::shared_ptr<Peer> peer_of(const net::ip::address& address);
  std::shared_ptr<Peer> peer_of(const std::string& name);
  // Removes peers that hold no resource.
  void forget_peers() {
    std::erase_if(peers, [](const auto& each) { return each.second.use_count() == 1; });
  }

  const ServerOptions options;
  const Router& router;
  ServerObserver& observer;
  const Cors cors;
  const Admission admission;
  TrustedProxies proxies;
  std::shared_ptr<net::ssl::context> tls;  // of connections from now on; null: plain HTTP
  net::io_context io{1};
  std::map<Run, std::unique_ptr<WorkerPool>> pools;
  std::map<std::string, std::shared_ptr<Peer>> peers;
  std::unordered_set<Session*> sessions;  // each kept alive by its coroutine
  std::size_t connections = 0;            // that are served
  std::size_t guests = 0;                 // see Caller
  std::uint64_t bodies_bytes = 0;         // of requests not yet answered
  std::string date;                       // value of the Date header, refreshed by the tick
  std::string id_prefix;                  // of the request ids of this run
  std::uint64_t next_id = 0;
  bool stopping = false;
};

// Data in the head of an answer in addition to the answer itself.
struct HeadContext {
  std::string_view date;
  std::string_view request_id;
  bool chunked = false;
  bool keep_alive = true;
  bool http_1_0 = false;  // of the client, to which the answer must announce that the connection stays open
};

// Writes status line and headers into `head`, in one piece: Beast's field list and serializer take a fifth of
// the rate of small answers.
void write_head(std::string& head, const Response& response, const HeadContext& context);

// One connection: a coroutine that reads a request, answers it, and begins again.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(std::shared_ptr<Core> core, Caller caller);
  virtual ~Session() = default;

  void start();
  // Enforces the deadline of the session's present wait.
  void tick(Clock::time_point now);
  // The server stops: ends idle and endless exchanges, lets the rest finish.
  void begin_stop();
  // Closes the connection immediately. The session ends when no worker has its request any more.
  void cut();

  bool idle() const { return state_ == State::idle; }
  bool busy() const { return state_ == State::busy; }
  void discard_waiting() { claimed_ = true; }  // work that no thread has begun
  bool arriving() const { return busy() && !parser_->is_done(); }
  bool guest() const { return caller_.guest; }
  Clock::time_point since() const { return since_; }  // when it was opened or became idle
  const Peer* peer() const { return caller_.peer.get(); }

 protected:
  enum class State : std::uint8_t { idle, busy, ending };
  enum class Outcome : std::uint8_t { done, full, late, departed, cut };
  using Waiter = net::async_result<net::use_awaitable_t<Executor>, void()>::handler_type;
  using Parser = beast::http::request_parser<beast::http::string_body>;

  virtual Socket& socket() = 0;  // below the stream
  virtual Task<void> run() = 0;

  void begin_request();
  bool parse();
  bool enter();
  bool hold_body(std::uint64_t bytes);
  std::uint64_t body_limit() const {
    return endpoint_->max_body_bytes.value_or(core_->options.max_body_bytes);
  }
  void fill_request();
  bool refuse(Refusal refusal, unsigned status, std::string_view slug, std::string_view detail);
  void observe(bool streamed);
  void watch_source();
  Task<void> event();
  void wake();
  Task<Outcome> work(Run run);
  void do_work();
  void arm(Clock::duration time);
  void count_place(bool taken);
  void release_body();

  const std::shared_ptr<Core> core_;  // first: everything else needs the io_context in it
  Caller caller_;
  std::shared_ptr<Peer> client_;  // of the request: its token, else the peer or the client that a proxy names
  bool placed_ = false;
  State state_ = State::idle;
  Clock::time_point since_ = Clock::now();
  Clock::time_point deadline_ = never;
  bool expired_ = false;  // the deadline has passed: work in progress is cancelled
  bool cut_ = false;
  std::optional<Waiter> waiter_;  // of event()

  beast::flat_buffer buffer_;
  std::optional<Parser> parser_;
  bool reading_ahead_ = false;  // see StreamSession::watch
  bool departed_ = false;       // the client has sent its end
  std::uint64_t body_bytes_ = 0;

  Request request_;
  const Endpoint* endpoint_ = nullptr;
  Response response_;
  std::string head_;
  bool answered_ = false;  // response_ is the answer: nothing more of the request is read
  bool keep_alive_ = true;
  Clock::time_point received_{};  // unset while the request arrives
  std::size_t request_bytes_ = 0;
  std::size_t response_bytes_ = 0;

  std::stop_source stop_;
  Clock::duration patience_{};  // left for waiting and computing
  bool working_ = false;        // a worker reads request_ and writes made_, or piece_ and pulled_
  std::atomic<bool> claimed_{
      false};  // by the worker that begins the work, or by the session that gives it up
  std::optional<Response> made_;
  std::string piece_;
  StreamSource::Next pulled_ = StreamSource::Next::more;
  bool brief_ = false;  // the endpoint's `brief` is tried
  bool streaming_ = false;
  bool pull_again_ = false;
  std::atomic<bool> wake_posted_{false};
};

// A session on an accepted connection, over TLS where the core has a certificate.
std::shared_ptr<Session> make_session(std::shared_ptr<Core> core, Socket socket, Caller caller);

}  // namespace joulecast::http
