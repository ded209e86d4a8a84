#include "server/http/connection.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "server/http/problem.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

namespace bhttp = beast::http;
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
  switch (verb) {
    case bhttp::verb::get:
      return Method::get;
    case bhttp::verb::head:
      return Method::head;
    case bhttp::verb::post:
      return Method::post;
    case bhttp::verb::put:
      return Method::put;
    case bhttp::verb::patch:
      return Method::patch;
    case bhttp::verb::delete_:
      return Method::del;
    case bhttp::verb::options:
      return Method::options;
    default:
      return Method::other;
  }
}

bool is_sane_id(std::string_view id) {
  return !id.empty() && id.size() <= 64 && std::all_of(id.begin(), id.end(), [](char c) {
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

void append_number(std::string& text, std::uint64_t value, int base = 10) {
  char digits[24];
  const auto [end, code] = std::to_chars(digits, digits + sizeof digits, value, base);
  (void)code;  // 24 characters hold any 64-bit number
  text.append(digits, end);
}

bool has_header(const Response& response, std::string_view name) {
  return std::any_of(response.headers.begin(), response.headers.end(),
                     [&](const auto& header) { return equals_ignoring_case(header.first, name); });
}

std::string_view body_of(const Response& response) {
  return response.shared_body ? std::string_view(*response.shared_body) : std::string_view(response.body);
}

}  // namespace

Connection::Connection(std::shared_ptr<Core> core, ByteStream stream)
    : core_(std::move(core)),
      stream_(std::move(stream)),
      buffer_(core_->options.max_header_bytes + 2 * body_read_size) {
  reset_parser();
}

void Connection::reset_parser() {
  parser_.emplace();
  parser_->eager(true);
  parser_->header_limit(core_->options.max_header_bytes);
  parser_->body_limit(core_->options.max_body_bytes);
  continue_answered_ = false;
  request_bytes_ = 0;
  response_bytes_ = 0;
  streamed_ = false;
}

void Connection::start() {
  phase_ = Phase::idle;
  deadline_ = Clock::now() + core_->options.idle_timeout;
  read();
}

bool Connection::busy() const {
  return phase_ == Phase::reading || phase_ == Phase::handling || phase_ == Phase::writing ||
         phase_ == Phase::streaming;
}

void Connection::read() {
  if (read_pending_ || phase_ == Phase::closed) return;
  std::size_t wanted = read_size;
  if (phase_ == Phase::reading && parser_->is_header_done()) wanted = body_read_size;
  const std::size_t room = buffer_.max_size() - buffer_.size();
  wanted = std::min(wanted, room);
  if (wanted == 0) return;  // only while streaming: a client that pipelines this much waits
  read_pending_ = true;
  stream_.async_read_some(
      buffer_.prepare(wanted),
      [self = shared_from_this()](const auto& error, std::size_t bytes) { self->on_read(error, bytes); });
}

void Connection::on_read(const boost::system::error_code& error, std::size_t bytes) {
  read_pending_ = false;
  if (phase_ == Phase::closed) return;
  if (error) {
    // While a request is worked on nothing is read, so this is an end between, inside or during the answer of
    // requests; the latter only for streams.
    close();
    return;
  }
  buffer_.commit(bytes);
  switch (phase_) {
    case Phase::lingering:
      buffer_.consume(buffer_.size());
      read();
      break;
    case Phase::idle:
    case Phase::reading:
      advance();
      break;
    case Phase::streaming:
    case Phase::handling:
    case Phase::writing:
    case Phase::closed:
      break;  // the next request, sent during a stream: it waits for its turn
  }
}

// Parses what has arrived; one request at a time, so that answers leave in the order of the requests.
void Connection::advance() {
  if (phase_ == Phase::idle) {
    phase_ = Phase::reading;
    deadline_ = Clock::now() + core_->options.read_timeout;
  }
  while (buffer_.size() > 0 && !parser_->is_done()) {
    boost::system::error_code error;
    const std::size_t used = parser_->put(buffer_.cdata(), error);
    buffer_.consume(used);
    request_bytes_ += used;
    if (error == bhttp::error::need_more) {
      if (used == 0) break;
      continue;
    }
    if (error == bhttp::error::header_limit) {
      return refuse(Refusal::header_size, 431, "header-too-large",
                    "The request line and headers exceed " + std::to_string(core_->options.max_header_bytes) +
                        " bytes");
    }
    if (error == bhttp::error::body_limit) {
      return refuse(Refusal::body_size, 413, "too-large",
                    "The body exceeds " + std::to_string(core_->options.max_body_bytes) + " bytes");
    }
    if (error == bhttp::error::bad_version) {
      return refuse(Refusal::malformed, 505, "http-version", "Only HTTP/1.0 and HTTP/1.1 are spoken here");
    }
    if (error) return refuse(Refusal::malformed, 400, "malformed-request", error.message());
    if (used == 0) break;
  }
  if (parser_->is_done()) return dispatch();
  if (parser_->is_header_done() && !continue_answered_) return answer_continue();
  read();
}

void Connection::answer_continue() {
  continue_answered_ = true;
  const auto& message = parser_->get();
  const auto expect = message.find(bhttp::field::expect);
  if (expect == message.end() || message.version() < 11) return read();
  if (!equals_ignoring_case(trim(view(expect->value())), "100-continue")) {
    return refuse(Refusal::malformed, 417, "expectation-failed",
                  "Only the expectation 100-continue is known here");
  }
  head_ = "HTTP/1.1 100 Continue\r\n\r\n";
  write({net::buffer(head_), {}, {}}, [self = shared_from_this()](const auto& error, std::size_t) {
    if (self->phase_ == Phase::closed) return;
    if (error) return self->close();
    self->read();
  });
}

void Connection::fill_request() {
  const auto& message = parser_->get();
  request_.method = method_of(message.method());
  request_.target = view(message.target());
  request_.headers.clear();
  for (const auto& field : message)
    request_.headers.emplace_back(view(field.name_string()), view(field.value()));
  request_.body = std::move(parser_->get().body());
  const auto id = request_.header("x-request-id");
  if (is_sane_id(id)) {
    request_.id = id;
  } else {
    request_.id = core_->id_prefix;
    append_number(request_.id, core_->next_id++);
  }
  request_.stop = core_->patience.get_token();
}

void Connection::dispatch() {
  received_ = Clock::now();
  phase_ = Phase::handling;
  keep_alive_ = parser_->keep_alive();
  fill_request();
  endpoint_ = nullptr;

  const auto hosts = std::count_if(request_.headers.begin(), request_.headers.end(), [](const auto& header) {
    return equals_ignoring_case(header.first, "host");
  });
  if (hosts > 1 || (hosts == 0 && parser_->get().version() >= 11)) {
    return refuse(Refusal::malformed, 400, "malformed-request", "HTTP/1.1 needs exactly one Host header");
  }

  auto match = core_->router.match(request_);
  endpoint_ = match.endpoint;
  if (match.answer) {
    response_ = std::move(*match.answer);
    return respond();
  }
  if (endpoint_->run == Run::io) {
    response_ = core_->router.run(*endpoint_, request_);
    return respond();
  }
  if (auto answer = core_->router.run_brief(*endpoint_, request_)) {
    response_ = std::move(*answer);
    return respond();
  }
  // While the worker has the request the I/O thread touches neither request_ nor response_.
  const bool taken = core_->workers->submit([self = shared_from_this()] {
    self->response_ = self->core_->router.run(*self->endpoint_, self->request_);
    net::post(self->core_->io, [self] { self->respond(); });
  });
  if (!taken) {
    core_->observer.refused(Refusal::worker_queue);
    response_ = problem(503, "unavailable", "Too many requests are waiting", request_.id);
    respond();
  }
}

void Connection::refuse(Refusal refusal, unsigned status, std::string_view slug, std::string_view detail) {
  core_->observer.refused(refusal);
  if (phase_ != Phase::handling) {
    received_ = Clock::now();
    request_.id = core_->id_prefix;
    append_number(request_.id, core_->next_id++);
    request_.method = Method::other;
    request_.target = {};
    endpoint_ = nullptr;
  }
  refused_ = true;
  keep_alive_ = false;
  response_ = problem(status, slug, detail, request_.id);
  respond();
}

void Connection::turn_away() {
  refuse(Refusal::connections, 503, "unavailable", "Too many connections are open");
}

void Connection::write_head(bool chunked) {
  const unsigned status = response_.status;
  const bool bodyless = status == 204 || status == 304 || status < 200;
  head_.clear();
  head_.append("HTTP/1.1 ");
  append_number(head_, status);
  head_.append(" ").append(reason_phrase(status)).append("\r\nDate: ").append(core_->date).append("\r\n");
  if (!response_.content_type.empty() && !bodyless)
    append_header(head_, "Content-Type", response_.content_type);
  if (chunked) {
    head_.append("Transfer-Encoding: chunked\r\n");
  } else if (!response_.stream && !bodyless) {
    head_.append("Content-Length: ");
    append_number(head_, body_of(response_).size());
    head_.append("\r\n");
  }
  if (!keep_alive_) {
    head_.append("Connection: close\r\n");
  } else if (!refused_ && parser_->get().version() < 11) {
    head_.append("Connection: keep-alive\r\n");
  }
  head_.append("X-Request-Id: ").append(request_.id).append("\r\nX-Content-Type-Options: nosniff\r\n");
  if (!has_header(response_, "Cache-Control")) head_.append("Cache-Control: no-store\r\n");
  for (const auto& [name, value] : response_.headers) append_header(head_, name, value);
  head_.append("\r\n");
}

template <class Done>
void Connection::write(std::array<net::const_buffer, 3> buffers, Done done) {
  deadline_ = Clock::now() + core_->options.write_timeout;
  net::async_write(
      stream_, buffers,
      [this](const boost::system::error_code& error, std::size_t sent) -> std::size_t {
        if (sent > 0) deadline_ = Clock::now() + core_->options.write_timeout;
        return error ? 0 : 256 * 1024;
      },
      std::move(done));
}

void Connection::respond() {
  if (phase_ == Phase::closed) return;
  if (core_->stopping) keep_alive_ = false;
  const bool old_client = !refused_ && parser_->get().version() < 11;
  const bool head_only = request_.method == Method::head;
  if (response_.stream && old_client) keep_alive_ = false;
  chunked_ = response_.stream != nullptr && !old_client;
  write_head(chunked_);
  response_bytes_ = head_.size();

  if (response_.stream && !head_only) {
    source_ = std::move(response_.stream);
    phase_ = Phase::streaming;
    streamed_ = true;
    end_stream_ = core_->stopping && source_->endless();
    pull_again_ = true;
    source_->on_wake([weak = weak_from_this()] {
      const auto self = weak.lock();
      if (!self || self->wake_posted_.exchange(true)) return;
      net::post(self->core_->io, [weak] {
        if (const auto connection = weak.lock()) connection->woken();
      });
    });
    piece_leaving_ = true;
    next_ = StreamSource::Next::more;
    write({net::buffer(head_), {}, {}},
          [self = shared_from_this()](const auto& error, std::size_t) { self->on_piece_written(error); });
    // Notices when the client leaves. One read only: what it brings stays in the buffer, which must not move
    // under a pending read when the stream ends and the next request is parsed.
    if (buffer_.size() == 0) read();
    return;
  }
  response_.stream.reset();
  phase_ = Phase::writing;
  std::string_view body;
  if (!head_only && response_.status != 204 && response_.status != 304) body = body_of(response_);
  response_bytes_ += body.size();
  write({net::buffer(head_), net::buffer(body.data(), body.size()), {}},
        [self = shared_from_this()](const auto& error, std::size_t) { self->on_written(error); });
}

void Connection::on_written(const boost::system::error_code& error) {
  if (phase_ == Phase::closed) return;
  finish_exchange();
  if (error) return close();
  if (!keep_alive_ || core_->stopping) return linger();
  reset_parser();
  if (buffer_.size() == 0 && buffer_.capacity() > kept_buffer_bytes && !read_pending_)
    buffer_.shrink_to_fit();
  phase_ = Phase::idle;
  deadline_ = Clock::now() + core_->options.idle_timeout;
  if (buffer_.size() > 0) return advance();
  read();
}

void Connection::finish_exchange() {
  core_->observer.exchanged({endpoint_ != nullptr ? std::string_view(endpoint_->operation_id) : "unmatched",
                             request_.method, response_.status,
                             std::chrono::duration<double>(Clock::now() - received_).count(), request_bytes_,
                             response_bytes_, request_.target, request_.id, streamed_});
}

// Closing with unread bytes in the socket makes the kernel discard the answer on its way to the client; so
// send our end first and read on for a while.
void Connection::linger() {
  boost::system::error_code ignored;
  stream_.shutdown(net::ip::tcp::socket::shutdown_send, ignored);
  phase_ = Phase::lingering;
  deadline_ = Clock::now() + (core_->stopping ? linger_time_at_stop : linger_time);
  if (!read_pending_) buffer_.consume(buffer_.size());
  read();
}

void Connection::pump() {
  if (phase_ != Phase::streaming || pulling_ || piece_leaving_) return;
  pulling_ = true;
  pull_again_ = false;
  pulled_ = Clock::now();
  piece_.clear();
  if (end_stream_) return on_pulled(StreamSource::Next::end);
  if (!source_->on_worker()) return on_pulled(source_->pull(piece_));
  core_->workers->submit_admitted([self = shared_from_this(), source = source_] {
    const auto next = source->pull(self->piece_);
    net::post(self->core_->io, [self, next] { self->on_pulled(next); });
  });
}

void Connection::on_pulled(StreamSource::Next next) {
  pulling_ = false;
  if (phase_ != Phase::streaming) return;
  if (next == StreamSource::Next::abort) {
    if (source_->hopeless()) core_->observer.refused(Refusal::slow_stream);
    finish_exchange();
    return close();
  }
  next_ = next;
  frame_.clear();
  std::string_view tail;
  if (chunked_) {
    if (!piece_.empty()) {
      append_number(frame_, piece_.size(), 16);
      frame_.append("\r\n");
    }
    tail = piece_.empty() ? (next == StreamSource::Next::end ? "0\r\n\r\n" : "")
                          : (next == StreamSource::Next::end ? "\r\n0\r\n\r\n" : "\r\n");
  }
  if (piece_.empty() && tail.empty()) {
    if (next == StreamSource::Next::end) {
      piece_leaving_ = true;
      return on_piece_written({});
    }
    if (next == StreamSource::Next::more || pull_again_) {
      net::post(core_->io, [self = shared_from_this()] { self->pump(); });
    }
    return;
  }
  piece_leaving_ = true;
  response_bytes_ += piece_.size();
  write({net::buffer(frame_), net::buffer(piece_), net::buffer(tail.data(), tail.size())},
        [self = shared_from_this()](const auto& error, std::size_t) { self->on_piece_written(error); });
}

void Connection::on_piece_written(const boost::system::error_code& error) {
  piece_leaving_ = false;
  if (phase_ != Phase::streaming) return;
  if (error) {
    finish_exchange();
    return close();
  }
  if (next_ == StreamSource::Next::end) {
    drop_stream();
    return on_written({});
  }
  if (next_ == StreamSource::Next::more || pull_again_ || end_stream_) pump();
}

void Connection::woken() {
  wake_posted_.store(false);
  if (phase_ != Phase::streaming) return;
  if (source_->hopeless()) {
    core_->observer.refused(Refusal::slow_stream);
    finish_exchange();
    return close();
  }
  pull_again_ = true;
  pump();
}

void Connection::drop_stream() {
  if (!source_) return;
  source_->cancel();
  source_.reset();
}

void Connection::tick(Clock::time_point now) {
  switch (phase_) {
    case Phase::idle:
    case Phase::lingering:
      if (now >= deadline_) close();
      break;
    case Phase::reading:
      if (now >= deadline_) {
        refuse(Refusal::read_timeout, 408, "timeout", "The request did not arrive in time");
      }
      break;
    case Phase::writing:
      if (now >= deadline_) {
        core_->observer.refused(Refusal::write_timeout);
        close();
      }
      break;
    case Phase::streaming:
      if (piece_leaving_ && now >= deadline_) {
        core_->observer.refused(Refusal::write_timeout);
        close();
      } else if (now - pulled_ >= poll_stream_every) {
        pump();
      }
      break;
    case Phase::handling:
    case Phase::closed:
      break;
  }
}

void Connection::begin_stop() {
  if (phase_ == Phase::idle) {
    linger();
  } else if (phase_ == Phase::streaming && source_->endless()) {
    end_stream_ = true;
    pump();
  }
}

void Connection::close() {
  if (phase_ == Phase::closed) return;
  phase_ = Phase::closed;
  drop_stream();
  boost::system::error_code ignored;
  stream_.shutdown(net::ip::tcp::socket::shutdown_both, ignored);
  stream_.close(ignored);
  const auto self = shared_from_this();
  core_->connections.erase(this);
  core_->observer.connections(core_->connections.size());
}

}  // namespace joulecast::http
