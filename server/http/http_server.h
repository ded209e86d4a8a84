#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "server/http/router.h"

namespace joulecast::http {

// PEM files.
struct TlsFiles {
  std::string certificate;  // with those that it builds on
  std::string key;
  std::string client_authorities;  // of every client's certificate; empty: none is required

  bool given() const { return !certificate.empty() || !key.empty() || !client_authorities.empty(); }
};

// Limits that keep one client from starving the others.
struct ServerOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;  // 0: the system chooses, see HttpServer::port()
  // Names of this service for its clients besides IP addresses, localhost and the host's name; "*": any.
  std::vector<std::string> allowed_hosts = {};
  std::vector<std::string> allowed_origins = {};  // of pages elsewhere that may use it; see Cors
  // IP addresses of proxies that are trusted with X-Forwarded-For as the origin of a request.
  std::vector<std::string> trusted_proxies = {};
  TlsFiles tls = {};                     // none given: plain HTTP
  unsigned worker_threads = 2;           // of Run::worker endpoints
  unsigned compute_threads = 2;          // of Run::compute endpoints
  std::size_t worker_queue = 256;        // requests waiting for one kind of threads; beyond: 503
  std::size_t client_requests = 64;      // waiting or computing for one client; beyond: 429
  std::size_t max_connections = 1024;    // beyond: one of the address with most is closed, or else 503
  std::size_t client_connections = 256;  // of one address that is no trusted proxy
  std::uint32_t max_header_bytes = 16 * 1024;
  std::uint64_t max_body_bytes = 4 * 1024 * 1024;
  // Of all bodies not yet answered, a quarter of one client; beyond: 429, or the largest client's is cut.
  std::uint64_t max_bodies_bytes = 64 * 1024 * 1024;
  std::chrono::milliseconds read_timeout{10'000};   // from a request's first byte to its last
  std::chrono::milliseconds write_timeout{30'000};  // without progress of the answer
  std::chrono::milliseconds idle_timeout{60'000};   // between requests of one connection
  // Waiting and computing of one request, all pieces of a streamed answer together; beyond: 503.
  std::chrono::milliseconds request_deadline{30'000};
};

// The reason for which the server closed a connection or refused a request on its own.
enum class Refusal : std::uint8_t {
  connections,  // more than max_connections or client_connections, none of them idle
  evicted,      // an idle connection closed to make room for another
  header_size,
  body_size,
  bodies,  // more than max_bodies_bytes, or a client's quarter of it
  malformed,
  host,    // addressed under a name that is not allowed
  origin,  // a change requested by a foreign page
  read_timeout,
  write_timeout,
  worker_queue,
  client_requests,  // more than client_requests
  deadline,         // more than request_deadline
  departed,         // cancelled because the client left
  slow_stream,      // a client too slow for its event stream
  count_
};

std::string_view to_string(Refusal refusal);

// One answered request, for metrics.
struct Exchange {
  std::string_view operation = {};  // operation id, or "unmatched"
  unsigned status = 0;
  double duration_s = 0;  // from the last byte of the request to the last byte of the answer's head and body
  std::uint64_t request_bytes = 0;
  std::uint64_t response_bytes = 0;
  bool stream = false;  // of events: the duration is the client's choice
};

// Receives the server's events; called on the I/O thread, must not block.
class ServerObserver {
 public:
  virtual ~ServerObserver() = default;
  virtual void exchanged(const Exchange& /*exchange*/) {}
  virtual void refused(Refusal /*refusal*/) {}
  virtual void connections(std::size_t /*open*/) {}
};

// Whether the files can be used; errors name the setting.
Result<void> check_tls(const TlsFiles& files);

// HTTP/1.1 server: one I/O thread, small worker pools, keep-alive, pipelining answered in order. A client is
// the token that a request came with, or else an IPv4 address or the /64 network of an IPv6 address.
// Thread-safe where stated; router and observer must outlive it.
class HttpServer {
 public:
  // Binds, listens and starts its threads. Fails with Fault::unavailable when the address cannot be bound and
  // Fault::invalid when it is no IP address.
  static Result<std::unique_ptr<HttpServer>> start(const ServerOptions& options, const Router& router,
                                                   ServerObserver* observer = nullptr);
  ~HttpServer();

  // The port really bound.
  std::uint16_t port() const;

  // Reads the certificate and key again, for further connections; on an error the old ones stay. Any thread.
  Result<void> reload_tls();

  // Time since the I/O thread last ran its tick (every 100 ms), for a watchdog. Any thread.
  std::chrono::milliseconds silence() const;

  // Stops accepting, closes idle connections and endless streams, lets running requests finish until the
  // deadline, then cancels and closes the rest. Any thread but the server's own. Returns within a second of
  // the deadline; false if requests had to be cut off.
  bool stop(std::chrono::milliseconds deadline);

  // Nothing runs any more. After a stop only a handler that ignores its token delays it; destruction waits.
  bool ended() const;

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::http
