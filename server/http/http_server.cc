#include "server/http/http_server.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <ctime>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "server/http/connection.h"

namespace joulecast::http {
namespace {

using Tcp = net::ip::tcp;
constexpr std::chrono::milliseconds tick_period{100};
constexpr std::chrono::milliseconds stop_poll_period{10};
constexpr std::size_t turned_away_at_once =
    64;  // connections told 503 politely beyond the limit; others are cut

std::string http_date() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  static constexpr const char* days[] = {"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  static constexpr const char* months[] = {"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                           "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  char text[64];
  std::snprintf(text, sizeof text, "%s, %02d %s %04d %02d:%02d:%02d GMT", days[parts.tm_wday], parts.tm_mday,
                months[parts.tm_mon], parts.tm_year + 1900, parts.tm_hour, parts.tm_min, parts.tm_sec);
  return text;
}

std::string run_prefix() {
  std::random_device entropy;
  char text[24];
  std::snprintf(text, sizeof text, "%08x-", entropy());
  return text;
}

std::int64_t milliseconds_now() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now().time_since_epoch()).count();
}

ServerObserver& nobody() {
  static ServerObserver observer;
  return observer;
}

}  // namespace

std::string_view to_string(Refusal refusal) {
  switch (refusal) {
    case Refusal::connections:
      return "connections";
    case Refusal::header_size:
      return "header_size";
    case Refusal::body_size:
      return "body_size";
    case Refusal::malformed:
      return "malformed";
    case Refusal::read_timeout:
      return "read_timeout";
    case Refusal::write_timeout:
      return "write_timeout";
    case Refusal::worker_queue:
      return "worker_queue";
    case Refusal::slow_stream:
      return "slow_stream";
    case Refusal::count_:
      break;
  }
  return "unknown";
}

struct HttpServer::Impl {
  Impl(const ServerOptions& options, const Router& router, ServerObserver& observer)
      : core(std::make_shared<Core>(options, router, observer)), acceptor(core->io), timer(core->io) {}

  Result<void> open();
  void run();
  void accept();
  void schedule_tick();
  void tick();
  void begin_stop(std::chrono::milliseconds patience);
  bool settle();

  std::shared_ptr<Core> core;
  Tcp::acceptor acceptor;
  net::steady_timer timer;
  std::uint16_t port = 0;
  std::thread thread;
  std::atomic<std::int64_t> ticked_ms{0};
  Clock::time_point stop_deadline{};
  bool accept_at_tick = false;
  bool cut_off = false;
  std::mutex stop_mutex;
  bool stopped = false;
};

Result<void> HttpServer::Impl::open() {
  boost::system::error_code error;
  const auto address = net::ip::make_address(core->options.address, error);
  if (error) return invalid("http.address", "must be an IPv4 or IPv6 address, is " + core->options.address);
  const Tcp::endpoint endpoint(address, core->options.port);
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(Tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
  if (error) {
    return fail(Fault::unavailable, "http.port",
                "cannot listen on " + core->options.address + " port " + std::to_string(core->options.port) +
                    ": " + error.message());
  }
  port = acceptor.local_endpoint(error).port();
  core->date = http_date();
  core->id_prefix = run_prefix();
  ticked_ms = milliseconds_now();
  return {};
}

void HttpServer::Impl::run() {
  core->workers = std::make_unique<WorkerPool>(core->options.worker_threads, core->options.worker_queue);
  net::post(core->io, [this] {
    accept();
    schedule_tick();
  });
  thread = std::thread([this] { core->io.run(); });
}

void HttpServer::Impl::accept() {
  acceptor.async_accept([this](const boost::system::error_code& error, Tcp::socket socket) {
    if (!acceptor.is_open()) return;
    if (error) {
      // Out of descriptors or memory: retrying at once would spin; the next tick accepts again.
      if (error == boost::system::errc::too_many_files_open ||
          error == boost::system::errc::too_many_files_open_in_system ||
          error == net::error::no_buffer_space || error == net::error::no_memory) {
        accept_at_tick = true;
        return;
      }
      return accept();
    }
    boost::system::error_code ignored;
    socket.set_option(Tcp::no_delay(true), ignored);
    const std::size_t open = core->connections.size();
    if (open < core->options.max_connections + turned_away_at_once) {
      auto connection = std::make_shared<Connection>(core, std::move(socket));
      core->connections.emplace(connection.get(), connection);
      core->observer.connections(core->connections.size());
      if (open < core->options.max_connections) {
        connection->start();
      } else {
        connection->turn_away();
      }
    } else {
      core->observer.refused(Refusal::connections);
    }
    accept();
  });
}

void HttpServer::Impl::schedule_tick() {
  timer.expires_after(core->stopping ? stop_poll_period : tick_period);
  timer.async_wait([this](const boost::system::error_code& error) {
    if (!error) tick();
  });
}

void HttpServer::Impl::tick() {
  ticked_ms = milliseconds_now();
  core->date = http_date();
  const auto now = Clock::now();
  // A connection that closes leaves the map: walk over a copy.
  std::vector<std::shared_ptr<Connection>> all;
  all.reserve(core->connections.size());
  for (const auto& [key, connection] : core->connections) all.push_back(connection);
  for (const auto& connection : all) connection->tick(now);
  if (core->stopping && settle()) return;
  if (accept_at_tick && !core->stopping) {
    accept_at_tick = false;
    accept();
  }
  schedule_tick();
}

void HttpServer::Impl::begin_stop(std::chrono::milliseconds patience) {
  core->stopping = true;
  stop_deadline = Clock::now() + patience;
  boost::system::error_code ignored;
  acceptor.close(ignored);
  std::vector<std::shared_ptr<Connection>> all;
  for (const auto& [key, connection] : core->connections) all.push_back(connection);
  for (const auto& connection : all) connection->begin_stop();
  timer.cancel();
  net::post(core->io, [this] { tick(); });
}

// True when nothing is left; beyond the deadline cuts off what is.
bool HttpServer::Impl::settle() {
  const bool busy = std::any_of(core->connections.begin(), core->connections.end(),
                                [](const auto& entry) { return entry.second->busy(); });
  const bool late = Clock::now() >= stop_deadline;
  if (busy && !late) return false;
  // What is left when nothing is busy has been answered and only lingers for the client's end of the
  // connection.
  if (!core->connections.empty() && !late && !busy) return false;
  cut_off = busy;
  if (late) core->patience.request_stop();
  std::vector<std::shared_ptr<Connection>> all;
  for (const auto& [key, connection] : core->connections) all.push_back(connection);
  for (const auto& connection : all) connection->close();
  return true;
}

Result<std::unique_ptr<HttpServer>> HttpServer::start(const ServerOptions& options, const Router& router,
                                                      ServerObserver* observer) {
  auto impl = std::make_unique<Impl>(options, router, observer != nullptr ? *observer : nobody());
  if (auto opened = impl->open(); !opened) return tl::unexpected<Error>(opened.error());
  impl->run();
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

HttpServer::~HttpServer() {
  stop(std::chrono::milliseconds(0));
}

std::uint16_t HttpServer::port() const {
  return impl_->port;
}

std::chrono::milliseconds HttpServer::silence() const {
  return std::chrono::milliseconds(milliseconds_now() - impl_->ticked_ms.load());
}

bool HttpServer::stop(std::chrono::milliseconds deadline) {
  const std::lock_guard lock(impl_->stop_mutex);
  if (impl_->stopped) return !impl_->cut_off;
  impl_->stopped = true;
  net::post(impl_->core->io, [this, deadline] { impl_->begin_stop(deadline); });
  impl_->thread.join();          // returns when the last connection is closed and no handler is left
  impl_->core->workers.reset();  // workers may still finish requests that were cut off
  impl_->core->io.restart();
  impl_->core->io.run();  // lets what they posted go
  return !impl_->cut_off;
}

}  // namespace joulecast::http
