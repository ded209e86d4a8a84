#pragma once

// Private to server/http: the coroutines of a session.
#include "server/http/session.h"
// session.h stays first.
#include <algorithm>
#include <array>
#include <utility>

#include "server/http/problem.h"

namespace joulecast::http {

inline constexpr std::size_t read_size = 8 * 1024;
inline constexpr std::size_t body_read_size = 64 * 1024;
inline constexpr std::chrono::milliseconds linger_time{2000};
inline constexpr std::chrono::milliseconds linger_time_at_stop{250};
inline constexpr std::chrono::milliseconds poll_stream_every{1000};
inline constexpr const char* deprecated_since = "@1795651200";  // 2026-11-26, as in RFC 9745

// Differences between byte streams: a TLS stream has a handshake and an end of its own, selected by its type.
inline Task<bool> open_stream(Socket&) {
  co_return true;
}
inline Task<void> end_stream(Socket& socket) {
  boost::system::error_code ignored;
  socket.shutdown(Tcp::socket::shutdown_send, ignored);
  co_return;
}

// The coroutines, over any stream with async_read_some and async_write_some above a TCP socket. Deadlines are
// the session's own (see tick) and not those of beast::basic_stream, which closes the socket at a deadline: a
// request that does not arrive in time is answered 408.
template <class Stream>
class StreamSession final : public Session {
 public:
  StreamSession(std::shared_ptr<Core> core, Stream stream, Caller caller)
      : Session(std::move(core), std::move(caller)), stream_(std::move(stream)) {}

 private:
  Socket& socket() override { return beast::get_lowest_layer(stream_); }

  Task<void> run() override {
    arm(core_->options.read_timeout);
    bool open = co_await open_stream(stream_);
    while (open) {
      const bool arrived = co_await receive();
      if (arrived && !answered_) co_await answer();
      if (arrived) open = co_await send();
      if (arrived && open && keep_alive_ && !core_->stopping) continue;
      if (open && !cut_ && (arrived || core_->stopping)) co_await linger();
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
          parser_->get().count(beast::http::field::expect) > 0) {
        const Clock::time_point until = deadline_;
        const net::const_buffer go_on = net::buffer("HTTP/1.1 100 Continue\r\n\r\n", 25);
        const bool sent = co_await write(go_on);
        if (!sent) co_return false;
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
    boost::system::error_code error;
    const auto room = buffer_.prepare(wanted);
    const std::size_t bytes = co_await stream_.async_read_some(room, net::redirect_error(use_task, error));
    buffer_.commit(bytes);
    co_return !error && !cut_;
  }

  // Detects that the client leaves while its answer is made. One read: any bytes are the next request, which
  // waits in the buffer for its turn.
  void watch() {
    if (reading_ahead_ || departed_ || buffer_.size() > 0) return;
    reading_ahead_ = true;
    stream_.async_read_some(
        buffer_.prepare(read_size),
        [self = shared_from_this(), this](const boost::system::error_code& error, std::size_t bytes) {
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
    request_.body = std::move(parser_->get().body());
    const bool parsed = !endpoint_->request_schema.empty();  // never on this thread
    if (!parsed)
      made_ = endpoint_->run == Run::io ? core_->router.run(*endpoint_, request_)
                                        : core_->router.run_brief(*endpoint_, request_);
    if (made_) {
      response_ = std::move(*made_);
      co_return;
    }
    if (client_->requests >= core_->options.client_requests) {
      core_->observer.refused(Refusal::client_requests);
      response_ = problem(
          429, "too-many-requests",
          "This client already has " + std::to_string(client_->requests) + " requests waiting or computing",
          request_.id);
      co_return;
    }
    Outcome outcome = Outcome::done;
    brief_ = parsed && Router::may_be_brief(*endpoint_, request_);
    if (brief_) outcome = co_await work(Run::io);
    if (outcome == Outcome::done && !made_) {
      brief_ = false;
      if (endpoint_->run == Run::compute) watch();
      outcome = co_await work(endpoint_->run);
    }
    if (outcome == Outcome::done) {
      response_ = std::move(*made_);
    } else if (outcome == Outcome::full) {
      core_->observer.refused(Refusal::worker_queue);
      response_ = problem(503, "unavailable", "Too many requests are waiting", request_.id);
    } else if (outcome == Outcome::late) {
      refuse(Refusal::deadline, 503, "deadline",
             "The answer was not ready within http.request_deadline_s; request less");
    } else if (outcome == Outcome::departed) {
      refuse(Refusal::departed, 499, "cancelled", "The client closed its side before the answer was ready");
    }
    co_return;
  }

  // False when the answer could not be sent whole.
  Task<bool> send() {
    if (cut_) co_return false;
    if (core_->stopping) keep_alive_ = false;
    const bool old_client = parser_->get().version() < 11;
    const bool chunked = response_.stream && !old_client;
    const bool streamed = response_.stream && request_.method != Method::head;
    if (response_.stream && old_client) keep_alive_ = false;
    if (request_.deprecated || response_.deprecated)
      response_.headers.emplace_back("Deprecation", deprecated_since);
    core_->cors.add_headers(request_, response_);
    write_head(head_, response_, {core_->date, request_.id, chunked, keep_alive_, old_client});
    std::string_view body;
    if (request_.method != Method::head && response_.status != 204 && response_.status != 304)
      body = body_of(response_);
    response_bytes_ = head_.size() + body.size();
    const std::array<net::const_buffer, 2> whole{net::buffer(head_), net::buffer(body.data(), body.size())};
    bool sent = co_await write(whole);
    if (sent && streamed) sent = co_await send_stream(chunked);
    observe(streamed && response_.stream->endless());
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
        const Outcome outcome = co_await work(endpoint_->run == Run::io ? Run::worker : endpoint_->run);
        if (outcome == Outcome::late) core_->observer.refused(Refusal::deadline);
        next = outcome == Outcome::done ? pulled_ : StreamSource::Next::abort;
      }
      if (next == StreamSource::Next::abort) {
        if (source->must_close() && !cut_) core_->observer.refused(Refusal::slow_stream);
        co_return false;
      }
      if (!piece_.empty() && !cut_) {
        response_bytes_ += piece_.size();
        const net::const_buffer plain = net::buffer(piece_);
        const auto chunk = beast::http::make_chunk(plain);
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
    const auto last = beast::http::make_chunk_last();
    const bool ended = co_await write(last);
    co_return ended;
  }

  // The deadline is on progress: a slow client that takes some of it gains time.
  template <class Buffers>
  Task<bool> write(const Buffers& buffers) {
    arm(core_->options.write_timeout);
    boost::system::error_code error;
    const auto progress = [this](const boost::system::error_code& failed, std::size_t sent) -> std::size_t {
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
    arm(core_->stopping ? linger_time_at_stop : linger_time);
    co_await end_stream(stream_);
    bool more = true;
    while (more) {
      if (!reading_ahead_) buffer_.consume(buffer_.size());
      more = co_await read_some();
    }
  }

  Stream stream_;
};

}  // namespace joulecast::http
