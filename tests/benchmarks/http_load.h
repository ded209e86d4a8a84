#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace joulecast::benchmarks {

// One connection to 127.0.0.1 that sends requests and reads answers with a Content-Length. A failed exchange
// aborts, as a benchmark of failures is meaningless.
class HttpConnection {
 public:
  explicit HttpConnection(std::uint16_t port);
  ~HttpConnection();
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  // The answer's body, valid until the next call; aborts unless the status is 2xx.
  std::string_view exchange(const std::string& request);

 private:
  int socket_ = -1;
  std::string received_;
};

// A port of 127.0.0.1 without a listener.
std::uint16_t free_port();
bool can_connect(std::uint16_t port);

// "GET target" or, with a body, "POST target" of JSON.
std::string http_request_text(std::string_view target, std::string_view json_body = {});

struct LoadFigures {
  double rate_1_s = 0;
  double median_ms = 0;
  double p99_ms = 0;
};

// Eight clients, each of which repeats the request as soon as it is answered.
LoadFigures load_http(std::uint16_t port, const std::string& request, double seconds);

}  // namespace joulecast::benchmarks
