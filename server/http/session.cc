#include "server/http/session.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "server/http/problem.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

namespace bhttp = beast::http;
using boost::system::error_code;
constexpr std::size_t read_size = 8 * 1024;
constexpr std::size_t body_read_size = 64 * 1024;
constexpr std::size_t kept_buffer_bytes = 64 * 1024;
constexpr std::chrono::milliseconds linger_time{2000};
constexpr std::chrono::milliseconds linger_time_at_stop{250};
constexpr std::chrono::milliseconds poll_stream_every{1000};

std::string_view view(boost::string_view text) {
  return {text.data(), text.size()};
}

Method method_of(bhttp::verb verb) {
  static constexpr std::pair<bhttp::verb, Method> methods[] = {
      {bhttp::verb::get, Method::get},         {bhttp::verb::head, Method::head},
      {bhttp::verb::post, Method::post},       {bhttp::verb::put, Method::put},
      {bhttp::verb::patch, Method::patch},     {bhttp::verb::delete_, Method::del},
      {bhttp::verb::options, Method::options},
  };
  const auto known = std::ranges::find(methods, verb, &std::pair<bhttp::verb, Method>::first);
  return known != std::end(methods) ? known->second : Method::other;
}

bool is_sane_id(std::string_view id) {
  return !id.empty() && id.size() <= 64 && std::ranges::all_of(id, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  });
}

// Control characters would let a value forge further headers.
void append_header(std::string& head, std::string_view name, std::string_view value) {
  head.append(name).append(": ");
  for (const char c : value) head.push_back(static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? ' ' : c);
  head.append("\r\n");
}

std::string_view body_of(const Response& response) {
  return response.shared_body ? std::string_view(*response.shared_body) : std::string_view(response.body);
}

// What differs between byte streams. A TLS stream overloads both, with its handshake and its own end.
Task<bool> open_stream(Socket&) {
  co_return true;
}
Task<void> end_stream(Socket& socket) {
  error_code ignored;
  socket.shutdown(Tcp::socket::shutdown_send, ignored);
  co_return;
}

// The coroutines, over any stream with async_read_some and async_write_some above a TCP socket.
template <class Stream>
class StreamSession final : public Session {
 public:
  StreamSession(std::shared_ptr<Core> core, Stream stream, const net::ip::address& peer, bool guest)
      : Session(std::move(core), peer, guest), stream_(std::move(stream)) {}

 private:
  Socket& socket() override { return beast::get_lowest_layer(stream_); }

  Task<void> run() override {
    arm(core_->options.read_timeout);
    bool open = co_await open_stream(stream_);
    while (open) {
      open = co_await receive();
      if (!open && (cut_ || !core_->stopping)) break;
      if (open && !refused_) co_await answer();
      if (open) open = co_await send();
      if (open && keep_alive_ && !core_->stopping) continue;
      if (!cut_) co_await linger();
      break;
    }
    cut();
    while (working_) co_await event();
  }

  // Reads one request, or refuses it. False when the connection ends before it.
  Task<bool> receive() {
    begin_request();
    if (core_->stopping && buffer_.size() == 0) co_return false;
    bool continued = false;
    for (;;) {
      if (buffer_.size() > 0) {
        if (state_ == State::idle) {
          state_ = State::busy;
          arm(core_->options.read_timeout);
        }
        if (!parse() || parser_->is_done()) co_return !cut_;
      }
      if (parser_->is_header_done() && !std::exchange(continued, true) && parser_->get().version() >= 11 &&
          parser_->get().count(bhttp::field::expect) > 0) {
        const Clock::time_point until = deadline_;
        const net::const_buffer go_on = net::buffer("HTTP/1.1 100 Continue\r\n\r\n", 25);
        const bool told = co_await write(go_on);
        if (!told) co_return false;
        deadline_ = until;
      }
      const bool more = co_await read_some();
      if (!more && expired_ && state_ == State::busy) {
        refuse(Refusal::read_timeout, 408, "timeout", "The request did not arrive in time");
        co_return true;
      }
      if (!more) co_return false;
    }
  }

  // False at the end of the connection, when the deadline has passed or there is no room.
  Task<bool> read_some() {
    if (reading_ahead_) {
      while (reading_ahead_) co_await event();
      co_return !departed_ && !expired_ && !cut_;
    }
    const std::size_t wanted =
        std::min(parser_->is_header_done() ? body_read_size : read_size, buffer_.max_size() - buffer_.size());
    if (departed_ || cut_ || wanted == 0) co_return false;
    error_code error;
    const auto room = buffer_.prepare(wanted);
    const std::size_t bytes = co_await stream_.async_read_some(room, net::redirect_error(use_task, error));
    buffer_.commit(bytes);
    co_return !error && !cut_;
  }

  // Notices when the client leaves while its answer is made. One read: what it brings is the next request,
  // which waits in the buffer for its turn.
  void watch() {
    if (reading_ahead_ || departed_ || buffer_.size() > 0) return;
    reading_ahead_ = true;
    stream_.async_read_some(buffer_.prepare(read_size),
                            [self = shared_from_this(), this](const error_code& error, std::size_t bytes) {
                              reading_ahead_ = false;
                              buffer_.commit(bytes);
                              departed_ = error && error != net::error::operation_aborted;
                              if (departed_ && streaming_) cut();
                              wake();
                            });
  }

  Task<void> answer() {
    received_ = Clock::now();
    patience_ = core_->options.request_deadline;
    fill_request();
    auto match = core_->router.match(request_);
    endpoint_ = match.endpoint;
    if (guest_ && (endpoint_ == nullptr || !endpoint_->reserved)) {
      refuse(Refusal::connections, 503, "unavailable", "Too many connections are open");
      co_return;
    }
    if (match.answer) {
      response_ = std::move(*match.answer);
      co_return;
    }
    if (endpoint_->run == Run::io) {
      response_ = core_->router.run(*endpoint_, request_);
      co_return;
    }
    if (auto brief = core_->router.run_brief(*endpoint_, request_)) {
      response_ = std::move(*brief);
      co_return;
    }
    if (peer_->requests >= core_->options.client_requests) {
      core_->observer.refused(Refusal::client_requests);
      response_ = problem(
          429, "too-many-requests",
          "This client already has " + std::to_string(peer_->requests) + " requests waiting or computing",
          request_.id);
      co_return;
    }
    if (endpoint_->run == Run::compute) watch();
    const Outcome outcome = co_await work();
    switch (outcome) {
      case Outcome::done:
        response_ = std::move(made_);
        break;
      case Outcome::full:
        core_->observer.refused(Refusal::worker_queue);
        response_ = problem(503, "unavailable", "Too many requests are waiting", request_.id);
        break;
      case Outcome::late:
        refuse(Refusal::deadline, 503, "deadline",
               "The answer was not ready within http.request_deadline_s; ask for less at once");
        break;
      case Outcome::departed:
        refuse(Refusal::departed, 499, "cancelled", "The client closed its side before the answer was ready");
        break;
      case Outcome::cut:
        break;
    }
  }

  // False when the answer could not be sent whole.
  Task<bool> send() {
    if (cut_) co_return false;
    if (core_->stopping) keep_alive_ = false;
    const bool old_client = !refused_ && parser_->get().version() < 11;
    const bool chunked = response_.stream && !old_client;
    const bool streamed = response_.stream && request_.method != Method::head;
    if (response_.stream && old_client) keep_alive_ = false;
    write_head(chunked);
    std::string_view body;
    if (request_.method != Method::head && response_.status != 204 && response_.status != 304)
      body = body_of(response_);
    response_bytes_ = head_.size() + body.size();
    const std::array<net::const_buffer, 2> whole{net::buffer(head_), net::buffer(body.data(), body.size())};
    bool sent = co_await write(whole);
    if (sent && streamed) sent = co_await send_stream(chunked);
    observe(streamed);
    co_return sent;
  }

  Task<bool> send_stream(bool chunked) {
    const auto source = response_.stream;
    watch_source();
    watch();
    if (departed_) cut();
    auto next = StreamSource::Next::more;
    while (next != StreamSource::Next::end && !cut_) {
      pull_again_ = false;
      piece_.clear();
      if (core_->stopping && source->endless()) {
        next = StreamSource::Next::end;
      } else if (!source->on_worker()) {
        next = source->pull(piece_);
      } else {
        const Outcome outcome = co_await work();
        if (outcome == Outcome::late) core_->observer.refused(Refusal::deadline);
        next = outcome == Outcome::done ? pulled_ : StreamSource::Next::abort;
      }
      if (next == StreamSource::Next::abort) {
        if (source->hopeless() && !cut_) core_->observer.refused(Refusal::slow_stream);
        co_return false;
      }
      if (!piece_.empty() && !cut_) {
        response_bytes_ += piece_.size();
        const net::const_buffer plain = net::buffer(piece_);
        const auto chunk = bhttp::make_chunk(plain);
        bool written = false;
        if (chunked) {
          written = co_await write(chunk);
        } else {
          written = co_await write(plain);
        }
        if (!written) co_return false;
      }
      if (next == StreamSource::Next::wait) patience_ = core_->options.request_deadline;
      const auto poll = Clock::now() + poll_stream_every;
      while (next == StreamSource::Next::wait && !pull_again_ && !cut_ && Clock::now() < poll)
        co_await event();
    }
    streaming_ = false;
    if (cut_ || !chunked) co_return !cut_;
    const auto last = bhttp::make_chunk_last();
    const bool ended = co_await write(last);
    co_return ended;
  }

  // The deadline is on progress: a slow client that takes some of it gains time.
  template <class Buffers>
  Task<bool> write(const Buffers& buffers) {
    arm(core_->options.write_timeout);
    error_code error;
    const auto progress = [this](const error_code& failed, std::size_t sent) -> std::size_t {
      if (sent > 0) deadline_ = Clock::now() + core_->options.write_timeout;
      return failed ? 0 : 256 * 1024;
    };
    co_await net::async_write(stream_, buffers, progress, net::redirect_error(use_task, error));
    deadline_ = never;
    if (expired_ && !cut_) {
      core_->observer.refused(Refusal::write_timeout);
      cut();
    }
    co_return !error && !cut_;
  }

  // Closing with unread bytes in the socket makes the kernel discard the answer on its way to the client; so
  // send our end first and read on for a while.
  Task<void> linger() {
    state_ = State::ending;
    co_await end_stream(stream_);
    arm(core_->stopping ? linger_time_at_stop : linger_time);
    bool more = true;
    while (more) {
      if (!reading_ahead_) buffer_.consume(buffer_.size());
      more = co_await read_some();
    }
  }

  Stream stream_;
};

}  // namespace

std::shared_ptr<Session> make_session(std::shared_ptr<Core> core, Socket socket, const net::ip::address& peer,
                                      bool guest) {
  return std::make_shared<StreamSession<Socket>>(std::move(core), std::move(socket), peer, guest);
}

Session::Session(std::shared_ptr<Core> core, const net::ip::address& peer, bool guest)
    : core_(std::move(core)),
      address_(peer),
      guest_(guest),
      buffer_(core_->options.max_header_bytes + 2 * body_read_size) {
  auto& known = core_->peers[address_];
  if (!known) known = std::make_shared<Peer>();
  peer_ = known;
  ++peer_->connections;
  ++(guest_ ? core_->guests : core_->connections);
  core_->observer.connections(core_->connections + core_->guests);
  request_.stop = stop_.get_token();
}

void Session::start() {
  core_->sessions.insert(this);
  net::co_spawn(
      core_->io, [self = shared_from_this()] { return self->run(); },
      [self = shared_from_this()](const std::exception_ptr&) {
        self->cut();
        self->core_->bodies_bytes -= std::exchange(self->body_bytes_, 0);
        self->core_->sessions.erase(self.get());
        self->peer_.reset();
        const auto known = self->core_->peers.find(self->address_);
        if (known->second.use_count() == 1) self->core_->peers.erase(known);
      });
}

void Session::release_place() {
  if (!std::exchange(placed_, false)) return;
  --peer_->connections;
  --(guest_ ? core_->guests : core_->connections);
  core_->observer.connections(core_->connections + core_->guests);
}

void Session::cut() {
  release_place();
  if (std::exchange(cut_, true)) return;
  claimed_ = true;
  state_ = State::ending;
  stop_.request_stop();
  if (response_.stream) response_.stream->cancel();
  error_code ignored;
  socket().shutdown(Tcp::socket::shutdown_both, ignored);
  socket().close(ignored);
  wake();
}

void Session::arm(Clock::duration time) {
  deadline_ = Clock::now() + time;
  expired_ = false;
}

void Session::tick(Clock::time_point now) {
  if (streaming_) wake();
  if (now < deadline_) return;
  deadline_ = never;
  expired_ = true;
  error_code ignored;
  socket().cancel(ignored);
  wake();
}

void Session::begin_stop() {
  error_code ignored;
  if (state_ == State::idle) socket().cancel(ignored);
  pull_again_ = true;
  wake();
}

Task<void> Session::event() {
  return net::async_initiate<const net::use_awaitable_t<Executor>, void()>(
      [this](Waiter&& waiter) { waiter_.emplace(std::move(waiter)); }, use_task);
}

void Session::wake() {
  if (!waiter_) return;
  net::post(core_->io, std::move(*waiter_));
  waiter_.reset();
}

void Session::begin_request() {
  parser_.emplace();
  parser_->header_limit(core_->options.max_header_bytes);
  parser_->body_limit(core_->options.max_body_bytes);
  if (buffer_.size() == 0 && buffer_.capacity() > kept_buffer_bytes && !reading_ahead_)
    buffer_.shrink_to_fit();
  core_->bodies_bytes -= std::exchange(body_bytes_, 0);
  request_.body = std::string();
  request_.json.reset();
  response_.body = std::string();
  response_.stream.reset();
  endpoint_ = nullptr;
  refused_ = false;
  request_bytes_ = 0;
  since_ = Clock::now();
  deadline_ = since_ + core_->options.idle_timeout;
  expired_ = false;
  if (!cut_) state_ = State::idle;
}

// Parses what has arrived, of one request at a time, so that answers leave in the order of the requests.
// False when it is refused.
bool Session::parse() {
  const ServerOptions& limits = core_->options;
  while (buffer_.size() > 0 && !parser_->is_done()) {
    const bool in_head = !parser_->is_header_done();
    error_code error;
    const std::size_t used = parser_->put(buffer_.cdata(), error);
    buffer_.consume(used);
    request_bytes_ += used;
    const bool head_ended = in_head && parser_->is_header_done();
    // Beast's limit is on what one call sees.
    if (error == bhttp::error::header_limit ||
        (in_head && request_bytes_ + (head_ended ? 0 : buffer_.size()) > limits.max_header_bytes))
      return refuse(
          Refusal::header_size, 431, "header-too-large",
          "The request line and headers exceed " + std::to_string(limits.max_header_bytes) + " bytes");
    if (error == bhttp::error::body_limit)
      return refuse(Refusal::body_size, 413, "too-large",
                    "The body exceeds " + std::to_string(limits.max_body_bytes) + " bytes");
    if (error == bhttp::error::bad_version)
      return refuse(Refusal::malformed, 505, "http-version", "Only HTTP/1.0 and HTTP/1.1 are spoken here");
    if (error && error != bhttp::error::need_more)
      return refuse(Refusal::malformed, 400, "malformed-request", error.message());
    if (head_ended) {
      parser_->eager(true);
      if (const auto denied = core_->admission.deny(parser_->get().base()))
        return refuse(denied->refusal, denied->status, denied->slug, denied->detail);
    }
    const std::uint64_t body = parser_->get().body().size();
    core_->bodies_bytes += body - std::exchange(body_bytes_, body);
    if (core_->bodies_bytes > limits.max_bodies_bytes)
      return refuse(Refusal::bodies, 503, "unavailable", "Too many bodies are being received");
    if (used == 0) break;
  }
  if (buffer_.size() >= buffer_.max_size())
    return refuse(Refusal::malformed, 400, "malformed-request", "A line of the chunked body is too long");
  return true;
}

void Session::fill_request() {
  const auto& message = parser_->get();
  request_.method = method_of(message.method());
  request_.target = view(message.target());
  request_.headers.clear();
  for (const auto& field : message)
    request_.headers.emplace_back(view(field.name_string()), view(field.value()));
  request_.body = std::move(parser_->get().body());
  keep_alive_ = parser_->keep_alive() && !guest_;
  const auto id = request_.header("x-request-id");
  request_.id = is_sane_id(id) ? std::string(id) : core_->id_prefix + std::to_string(core_->next_id++);
}

// The connection ends after a refusal: where the next request begins, or what became of this one's work, is
// not known. Returns false.
bool Session::refuse(Refusal refusal, unsigned status, std::string_view slug, std::string_view detail) {
  core_->observer.refused(refusal);
  if (endpoint_ == nullptr) {
    received_ = Clock::now();
    request_.id = core_->id_prefix + std::to_string(core_->next_id++);
    request_.method = Method::other;
    request_.target = {};
  }
  refused_ = true;
  keep_alive_ = false;
  response_ = problem(status, slug, detail, request_.id);
  return false;
}

void Session::write_head(bool chunked) {
  const unsigned status = response_.status;
  const bool bodyless = status == 204 || status == 304 || status < 200;
  head_.assign("HTTP/1.1 ").append(std::to_string(status)).append(" ").append(reason_phrase(status));
  head_.append("\r\nDate: ").append(core_->date).append("\r\n");
  if (!response_.content_type.empty() && !bodyless)
    append_header(head_, "Content-Type", response_.content_type);
  if (chunked) {
    head_.append("Transfer-Encoding: chunked\r\n");
  } else if (!response_.stream && !bodyless) {
    head_.append("Content-Length: ").append(std::to_string(body_of(response_).size())).append("\r\n");
  }
  if (!keep_alive_) {
    head_.append("Connection: close\r\n");
  } else if (parser_->get().version() < 11) {
    head_.append("Connection: keep-alive\r\n");
  }
  head_.append("X-Request-Id: ").append(request_.id).append("\r\nX-Content-Type-Options: nosniff\r\n");
  if (std::ranges::none_of(response_.headers,
                           [](const auto& h) { return equals_ignoring_case(h.first, "Cache-Control"); }))
    head_.append("Cache-Control: no-store\r\n");
  for (const auto& [name, value] : response_.headers) append_header(head_, name, value);
  head_.append("\r\n");
}

void Session::observe(bool streamed) {
  core_->observer.exchanged({endpoint_ != nullptr ? std::string_view(endpoint_->operation_id) : "unmatched",
                             request_.method, response_.status,
                             std::chrono::duration<double>(Clock::now() - received_).count(), request_bytes_,
                             response_bytes_, request_.target, request_.id, streamed});
}

// Lets the source wake the session from any thread.
void Session::watch_source() {
  streaming_ = true;
  response_.stream->on_wake([weak = weak_from_this()] {
    const auto woken = weak.lock();
    if (!woken || woken->wake_posted_.exchange(true)) return;
    net::post(woken->core_->io, [weak] {
      const auto self = weak.lock();
      if (!self) return;
      self->wake_posted_ = false;
      if (!self->streaming_ || self->cut_) return;
      self->pull_again_ = true;
      if (self->response_.stream->hopeless()) {
        self->core_->observer.refused(Refusal::slow_stream);
        self->cut();
      }
      self->wake();
    });
  });
}

// Has the endpoint's threads run the handler or pull the next piece. Unless the outcome is `done` they may
// still do so when this returns.
Task<Session::Outcome> Session::work() {
  const auto job = [self = shared_from_this()] {
    if (!self->claimed_.exchange(true)) self->do_work();
    net::post(self->core_->io, [self] {
      self->working_ = false;
      if (self->peer_) --self->peer_->requests;
      if (auto waiter = std::exchange(self->waiter_, std::nullopt)) std::move (*waiter)();
    });
  };
  claimed_ = false;
  if (!core_->pool_of(endpoint_->run).submit(job, streaming_)) co_return Outcome::full;
  working_ = true;
  ++peer_->requests;
  const auto begun = Clock::now();
  arm(patience_);
  while (working_ && !cut_) {
    const bool unwanted = expired_ || departed_;
    if (unwanted && (!claimed_.exchange(true) || endpoint_->run != Run::write)) break;
    co_await event();
  }
  patience_ -= Clock::now() - begun;
  deadline_ = never;
  if (cut_) co_return Outcome::cut;
  if (!working_) co_return Outcome::done;
  stop_.request_stop();
  co_return expired_ ? Outcome::late : Outcome::departed;
}

void Session::do_work() {
  if (streaming_) {
    pulled_ = response_.stream->pull(piece_);
  } else {
    made_ = core_->router.run(*endpoint_, request_);
  }
}

}  // namespace joulecast::http
