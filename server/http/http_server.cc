#include "server/http/http_server.h"

#include <atomic>
#include <exception>
#include <future>
#include <iterator>
#include <mutex>
#include <thread>
#include <tuple>

#include "access/sha256.h"
#include "base/host_clock.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "server/http/tls.h"

namespace joulecast::http {
namespace {

constexpr std::chrono::milliseconds tick_period{100};
constexpr std::chrono::milliseconds stop_poll_period{10};
constexpr std::chrono::milliseconds notice_time{1000};  // for cancelled work to notice it
constexpr std::size_t guest_places = 64;
constexpr std::size_t operations_queue = 64;

std::string http_date() {
  return format_utc(host_utime_us(), "%a, %d %b %Y %H:%M:%S GMT");
}

std::int64_t milliseconds_now() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now().time_since_epoch()).count();
}

}  // namespace

std::string_view to_string(Refusal refusal) {
  static constexpr std::string_view names[] = {
      "connections", "evicted",  "header_size",  "body_size",     "bodies",       "malformed",
      "host",        "origin",   "read_timeout", "write_timeout", "worker_queue", "client_requests",
      "deadline",    "departed", "slow_stream"};
  static_assert(std::size(names) == static_cast<std::size_t>(Refusal::count_));
  return names[static_cast<std::size_t>(refusal)];
}

struct HttpServer::Impl {
  Impl(const ServerOptions& options, const Router& router, ServerObserver& observer)
      : core(std::make_shared<Core>(options, router, observer)),
        acceptor(core->io),
        ticking(core->io),
        retry(core->io) {}

  Result<void> open();
  void run();
  Task<void> accept();
  void admit(Socket socket);
  bool make_room(const Peer* of, bool guests);
  Task<void> tick();
  void begin_stop(std::chrono::milliseconds grace);
  bool settled();

  std::shared_ptr<Core> core;
  net::basic_socket_acceptor<Tcp, Executor> acceptor;
  Timer ticking, retry;
  std::uint16_t port = 0;
  std::thread thread;
  std::shared_future<void> ended;
  std::atomic<std::int64_t> ticked_ms{0};
  Clock::time_point stop_deadline{};
  bool cut_off = false;
  std::mutex stop_mutex;
  bool stopped = false;
};

Result<void> HttpServer::Impl::open() {
  TRY_ASSIGN(const auto address, address_of(core->options.address, "http.address"));
  TRY_ASSIGN(core->proxies, parse_proxies(core->options.trusted_proxies));
  if (core->options.tls.given()) {
    TRY_ASSIGN(core->tls, make_tls(core->options.tls));
  }
  const Tcp::endpoint endpoint(address, core->options.port);
  boost::system::error_code error;
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(Tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
  if (error)
    return fail(Fault::unavailable, "http.port",
                "cannot listen on " + core->options.address + " port " + std::to_string(core->options.port) +
                    ": " + error.message());
  port = acceptor.local_endpoint(error).port();
  core->date = http_date();
  core->id_prefix = access::random_hex(4) + "-";
  ticked_ms = milliseconds_now();
  return {};
}

void HttpServer::Impl::run() {
  const ServerOptions& options = core->options;
  for (const auto& [run, threads, queue] : {std::tuple{Run::operations, 1U, operations_queue},
                                            {Run::io, 1U, options.worker_queue},
                                            {Run::worker, options.worker_threads, options.worker_queue},
                                            {Run::compute, options.compute_threads, options.worker_queue},
                                            {Run::write, 1U, options.worker_queue}})
    core->pools[run] = std::make_unique<WorkerPool>(threads, queue);
  const auto rethrow = [](const std::exception_ptr& fault) {
    if (fault) std::rethrow_exception(fault);
  };
  net::co_spawn(
      core->io, [this] { return accept(); }, rethrow);
  net::co_spawn(
      core->io, [this] { return tick(); }, rethrow);
  std::promise<void> end;
  ended = end.get_future().share();
  thread = std::thread([this, end = std::move(end)]() mutable {
    core->io.run();  // returns when the last session has ended, and with it its work
    end.set_value();
  });
}

Task<void> HttpServer::Impl::accept() {
  while (acceptor.is_open()) {
    boost::system::error_code error;
    Socket socket = co_await acceptor.async_accept(net::redirect_error(use_task, error));
    if (!error) {
      admit(std::move(socket));
    } else if (acceptor.is_open()) {
      // Out of descriptors or memory: an immediate retry would spin.
      retry.expires_after(tick_period);
      co_await retry.async_wait(net::redirect_error(use_task, error));
    }
  }
}

// Where the peer holds all that one may, its longest idle connection makes room; where the server is full,
// one of the peer with most, without a whole request. Without one the connection becomes a guest.
void HttpServer::Impl::admit(Socket socket) {
  boost::system::error_code ignored;
  socket.set_option(Tcp::no_delay(true), ignored);
  const net::ip::address address = unmapped(socket.remote_endpoint(ignored).address());
  const auto peer = core->peer_of(address);
  const bool crowded =
      peer->connections >= core->options.client_connections && !core->proxies.contains(address);
  const bool full = core->connections >= core->options.max_connections;
  const bool guest = (crowded || full) && !make_room(crowded ? peer.get() : nullptr, false);
  if (guest && core->guests >= guest_places) make_room(nullptr, true);
  make_session(core, std::move(socket), {address, peer, guest})->start();
}

// Closes the longest idle connection of one peer if given, else the oldest of those that idle or send their
// request, of the peer that holds most; of guests any.
bool HttpServer::Impl::make_room(const Peer* of, bool guests) {
  Session* oldest = nullptr;
  const auto sooner = [](const Session* a, const Session* b) {
    if (a->peer() != b->peer() && a->peer()->connections != b->peer()->connections)
      return a->peer()->connections > b->peer()->connections;
    return a->since() < b->since();
  };
  for (Session* each : core->sessions) {
    const bool possible = each->guest() == guests && (of == nullptr || each->peer() == of) &&
                          (each->idle() || (of == nullptr && (guests ? each->busy() : each->arriving())));
    if (possible && (oldest == nullptr || sooner(each, oldest))) oldest = each;
  }
  if (oldest == nullptr) return false;
  core->observer.refused(Refusal::evicted);
  oldest->cut();
  return true;
}

Task<void> HttpServer::Impl::tick() {
  for (;;) {
    ticked_ms = milliseconds_now();
    core->date = http_date();
    for (Session* session : core->sessions) session->tick(Clock::now());
    core->forget_peers();
    if (core->stopping && settled()) co_return;
    ticking.expires_after(core->stopping ? stop_poll_period : tick_period);
    boost::system::error_code ignored;
    co_await ticking.async_wait(net::redirect_error(use_task, ignored));
  }
}

void HttpServer::Impl::begin_stop(std::chrono::milliseconds grace) {
  core->stopping = true;
  stop_deadline = Clock::now() + grace;
  boost::system::error_code ignored;
  acceptor.close(ignored);
  for (Session* session : core->sessions) session->begin_stop();
  ticking.cancel();
}

// True when all work has ended; after the deadline it cuts off the rest.
bool HttpServer::Impl::settled() {
  if (core->sessions.empty()) return true;
  if (Clock::now() < stop_deadline) return false;
  for (Session* session : core->sessions) session->discard_waiting();
  for (Session* session : core->sessions) {
    cut_off = cut_off || session->busy();
    session->cut();
  }
  return true;
}

Result<std::unique_ptr<HttpServer>> HttpServer::start(const ServerOptions& options, const Router& router,
                                                      ServerObserver* observer) {
  static ServerObserver nobody;
  auto impl = std::make_unique<Impl>(options, router, observer != nullptr ? *observer : nobody);
  TRY(impl->open());
  impl->run();
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

HttpServer::~HttpServer() {
  stop(std::chrono::milliseconds(0));
  impl_->thread.join();
  impl_->core->pools.clear();
  impl_->core->io.restart();
  impl_->core->io.run();  // runs handlers that workers posted
}

std::uint16_t HttpServer::port() const {
  return impl_->port;
}

Result<void> check_tls(const TlsFiles& files) {
  TRY(make_tls(files));
  return {};
}

Result<void> HttpServer::reload_tls() {
  const TlsFiles& files = impl_->core->options.tls;
  if (!files.given()) return {};
  TRY_ASSIGN(auto tls, make_tls(files));
  net::post(impl_->core->io, [core = impl_->core, fresh = std::move(tls)] { core->tls = fresh; });
  return {};
}

std::chrono::milliseconds HttpServer::silence() const {
  return std::chrono::milliseconds(milliseconds_now() - impl_->ticked_ms.load());
}

bool HttpServer::stop(std::chrono::milliseconds deadline) {
  const std::lock_guard lock(impl_->stop_mutex);
  if (!std::exchange(impl_->stopped, true))
    net::post(impl_->core->io, [this, deadline] { impl_->begin_stop(deadline); });
  return impl_->ended.wait_for(deadline + notice_time) == std::future_status::ready && !impl_->cut_off;
}

bool HttpServer::ended() const {
  return impl_->ended.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace joulecast::http
