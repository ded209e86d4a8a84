#include "server/http/session.h"

#include <limits>
#include <utility>

#include "server/http/problem.h"
#include "server/http/stream_session.h"
#include "server/http/text.h"
#include "server/http/tls.h"

namespace joulecast::http {
namespace {

namespace bhttp = beast::http;
using boost::system::error_code;
constexpr std::size_t kept_buffer_bytes = 64 * 1024;

Method method_of(bhttp::verb verb) {
  static constexpr bhttp::verb verbs[] = {bhttp::verb::get,    bhttp::verb::head,  bhttp::verb::post,
                                          bhttp::verb::put,    bhttp::verb::patch, bhttp::verb::delete_,
                                          bhttp::verb::options};
  return static_cast<Method>(std::ranges::find(verbs, verb) - verbs);  // the last one is Method::other
}

// Of header and trailer fields.
std::size_t bytes_of(const bhttp::fields& fields) {
  std::size_t bytes = 0;
  for (const auto& field : fields) bytes += field.name_string().size() + field.value().size();
  return bytes;
}

// Control characters would let a value forge further headers.
void append_header(std::string& head, std::string_view name, std::string_view value) {
  head.append(name).append(": ");
  for (const char c : value) head.push_back(static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? ' ' : c);
  head.append("\r\n");
}

bool is_sane_id(std::string_view id) {
  return !id.empty() && id.size() <= 64 && std::ranges::all_of(id, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  });
}

}  // namespace

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

std::shared_ptr<Peer> Core::peer_of(const net::ip::address& address) {
  net::ip::address limited = address;
  if (address.is_v6()) {
    auto bytes = address.to_v6().to_bytes();
    std::fill(bytes.begin() + 8, bytes.end(), static_cast<unsigned char>(0));
    limited = net::ip::address_v6(bytes);
  }
  return peer_of(limited.to_string());
}

std::shared_ptr<Peer> Core::peer_of(const std::string& name) {
  auto& known = peers[name];
  if (!known) known = std::make_shared<Peer>(Peer{.name = name});
  return known;
}

std::shared_ptr<Session> make_session(std::shared_ptr<Core> core, Socket socket, Caller caller) {
  if (core->tls) return make_tls_session(std::move(core), std::move(socket), std::move(caller));
  return std::make_shared<StreamSession<Socket>>(std::move(core), std::move(socket), std::move(caller));
}

Session::Session(std::shared_ptr<Core> core, Caller caller)
    : core_(std::move(core)),
      caller_(std::move(caller)),
      buffer_(core_->options.max_header_bytes + 2 * body_read_size) {
  count_place(true);
}

void Session::start() {
  core_->sessions.insert(this);
  net::co_spawn(
      core_->io, [self = shared_from_this()] { return self->run(); },
      [self = shared_from_this()](const std::exception_ptr&) {
        self->cut();
        self->release_body();
        self->core_->sessions.erase(self.get());
        self->caller_.peer.reset();
        self->client_.reset();
      });
}

void Session::count_place(bool taken) {
  if (placed_ == taken) return;
  placed_ = taken;
  const std::size_t change = taken ? 1 : std::size_t(-1);
  caller_.peer->connections += change;
  (caller_.guest ? core_->guests : core_->connections) += change;
  core_->observer.connections(core_->connections + core_->guests);
}

void Session::release_body() {
  if (parser_) parser_->get().body() = std::string();
  if (client_) client_->bodies_bytes -= body_bytes_;
  core_->bodies_bytes -= std::exchange(body_bytes_, 0);
}

void Session::cut() {
  count_place(false);
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
  release_body();
  parser_.emplace();
  parser_->header_limit(core_->options.max_header_bytes);
  parser_->body_limit(std::numeric_limits<std::uint64_t>::max());  // until enter() sets one
  if (buffer_.size() == 0 && buffer_.capacity() > kept_buffer_bytes && !reading_ahead_)
    buffer_.shrink_to_fit();
  // Clear the previous exchange on this connection, so that its request is not mixed with this one.
  request_ = Request{};
  request_.stop = stop_.get_token();
  response_ = Response{};
  endpoint_ = nullptr;
  made_.reset();
  answered_ = false;
  received_ = {};
  request_bytes_ = 0;
  since_ = Clock::now();
  deadline_ = since_ + core_->options.idle_timeout;
  expired_ = false;
  if (!cut_) state_ = State::idle;
}

// Parses the received bytes, one request at a time, so that answers are sent in the order of the requests.
// False if the request is refused.
bool Session::parse() {
  const ServerOptions& limits = core_->options;
  while (buffer_.size() > 0 && !parser_->is_done()) {
    const bool in_head = !parser_->is_header_done();
    error_code error;
    const std::size_t used = parser_->put(buffer_.cdata(), error);
    buffer_.consume(used);
    request_bytes_ += used;
    const bool head_ended = in_head && parser_->is_header_done();
    // Beast's limit applies to the input of one call.
    if (error == bhttp::error::header_limit ||
        (in_head && request_bytes_ + (head_ended ? 0 : buffer_.size()) > limits.max_header_bytes))
      return refuse(
          Refusal::header_size, 431, "header-too-large",
          "The request line and headers exceed " + std::to_string(limits.max_header_bytes) + " bytes");
    if (error == bhttp::error::body_limit)
      return refuse(Refusal::body_size, 413, "too-large",
                    "The body exceeds " + std::to_string(body_limit()) + " bytes");
    if (error == bhttp::error::bad_version)
      return refuse(Refusal::malformed, 505, "http-version", "Only HTTP/1.0 and HTTP/1.1 are supported");
    if (error && error != bhttp::error::need_more)
      return refuse(Refusal::malformed, 400, "malformed-request", error.message());
    if (head_ended && !enter()) return false;
    if (!hold_body(parser_->get().body().size())) return false;
    if (used == 0) break;
  }
  // The parser takes a chunk's line, and all trailer fields, as a whole.
  if (parser_->is_header_done() &&
      (parser_->is_done() ? parser_->chunked() && bytes_of(parser_->get()) > limits.max_header_bytes
                          : buffer_.size() > limits.max_header_bytes))
    return refuse(Refusal::malformed, 400, "malformed-request",
                  "The trailer fields or a line of the chunked body are too long");
  return true;
}

// Checks that need the head alone, before any of the body is kept; its fields are the request's, those of a
// trailer are not (RFC 9110 section 6.5.1). False when the answer is certain.
bool Session::enter() {
  parser_->eager(true);
  if (const auto denied = core_->admission.deny(parser_->get().base(), core_->tls != nullptr))
    return refuse(denied->refusal, denied->status, denied->slug, denied->detail);
  fill_request();
  Router::Match match = core_->router.match(request_);
  endpoint_ = match.endpoint;
  if (!request_.actor.empty()) client_ = core_->peer_of("token " + request_.actor);
  request_.client = client_->name;
  if (caller_.guest && (endpoint_ == nullptr || !endpoint_->reserved))
    return refuse(Refusal::connections, 503, "unavailable", "Too many connections are open");
  if (match.answer) {
    response_ = std::move(*match.answer);
    received_ = Clock::now();
    keep_alive_ = keep_alive_ && parser_->is_done();
    answered_ = true;
    return false;
  }
  const std::uint64_t declared = parser_->content_length().value_or(0);
  if (declared > body_limit())
    return refuse(Refusal::body_size, 413, "too-large",
                  "The body exceeds " + std::to_string(body_limit()) + " bytes");
  parser_->body_limit(body_limit());
  return hold_body(declared);
}

// Counts a body of at least that size. A client holds a quarter of all at most, but always one body; where
// all is taken, the client that holds most, and more than this one, loses its largest unfinished body. False
// when it is refused.
bool Session::hold_body(std::uint64_t bytes) {
  if (bytes <= body_bytes_) return true;
  const ServerOptions& limits = core_->options;
  const std::uint64_t more = bytes - body_bytes_, own = client_->bodies_bytes + more;
  if (own > std::max(limits.max_bodies_bytes / 4, limits.max_body_bytes))
    return refuse(Refusal::bodies, 429, "too-many-requests", "This client is sending too many bodies");
  const auto held = [](const Session* each) {
    return std::pair(each->client_->bodies_bytes, each->body_bytes_);
  };
  while (core_->bodies_bytes + more > limits.max_bodies_bytes) {
    Session* largest = nullptr;
    for (Session* each : core_->sessions)
      if (each->body_bytes_ > 0 && each->arriving() && each->client_->bodies_bytes > own &&
          (largest == nullptr || held(each) > held(largest)))
        largest = each;
    if (largest == nullptr)
      return refuse(Refusal::bodies, 503, "unavailable", "Too many bodies are being received");
    core_->observer.refused(Refusal::bodies);
    largest->cut();
    largest->release_body();
  }
  client_->bodies_bytes = own;
  core_->bodies_bytes += more;
  body_bytes_ = bytes;
  return true;
}

void Session::fill_request() {
  const auto& message = parser_->get();
  request_.method = method_of(message.method());
  request_.target = view(message.target());
  for (const auto& field : message)
    request_.headers.emplace_back(view(field.name_string()), view(field.value()));
  const net::ip::address client = client_of(caller_.address, core_->proxies, request_);
  request_.address = client.to_string();
  request_.secure = core_->tls != nullptr || (core_->proxies.contains(caller_.address) &&
                                              request_.header("x-forwarded-proto") == "https");
  client_ = client == caller_.address ? caller_.peer : core_->peer_of(client);
  keep_alive_ = parser_->keep_alive() && !caller_.guest;
  const auto id = request_.header("x-request-id");
  request_.id = is_sane_id(id) ? std::string(id) : core_->id_prefix + std::to_string(core_->next_id++);
}

// Returns false: the connection ends, since the next request's beginning and this one's result are unknown.
bool Session::refuse(Refusal refusal, unsigned status, std::string_view slug, std::string_view detail) {
  core_->observer.refused(refusal);
  if (received_ == Clock::time_point{}) {
    received_ = Clock::now();
    release_body();
  }
  if (request_.id.empty()) {
    request_.id = core_->id_prefix + std::to_string(core_->next_id++);
    request_.method = Method::other;
  }
  answered_ = true;
  keep_alive_ = false;
  response_ = problem(status, slug, detail, request_.id);
  return false;
}

void Session::observe(bool streamed) {
  core_->observer.exchanged({endpoint_ != nullptr ? std::string_view(endpoint_->operation_id) : "unmatched",
                             response_.status,
                             std::chrono::duration<double>(Clock::now() - received_).count(), request_bytes_,
                             response_bytes_, streamed});
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
      if (self->response_.stream->must_close()) {
        self->core_->observer.refused(Refusal::slow_stream);
        self->cut();
      }
      self->wake();
    });
  });
}

// Has threads of that kind run the handler or pull the next piece. Unless the outcome is `done` they may
// still do so when this returns.
Task<Session::Outcome> Session::work(Run run) {
  const auto job = [self = shared_from_this()] {
    if (!self->claimed_.exchange(true)) self->do_work();
    net::post(self->core_->io, [self] {
      self->working_ = false;
      if (self->client_) --self->client_->requests;
      if (auto waiter = std::exchange(self->waiter_, std::nullopt)) std::move (*waiter)();
    });
  };
  claimed_ = false;
  if (!core_->pools.at(run)->submit(job, streaming_)) co_return Outcome::full;
  working_ = true;
  ++client_->requests;
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
  } else if (brief_) {
    made_ = core_->router.run_brief(*endpoint_, request_);
  } else {
    made_ = core_->router.run(*endpoint_, request_);
    request_.json.reset();  // freeing it takes as long as parsing
    request_.input.reset();
  }
}

bool WorkerPool::submit(std::function<void()> task, bool admitted) {
  if (waiting_++ >= capacity_ && !admitted) {
    --waiting_;
    return false;
  }
  net::post(threads_, [this, task = std::move(task)] {
    --waiting_;
    task();
  });
  return true;
}

}  // namespace joulecast::http
