#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <string>

#include "fuzz.h"
#include "server/http/http_server.h"

using namespace joulecast;
using namespace joulecast::http;

namespace {

std::vector<Endpoint> table() {
  Endpoint echo;
  echo.method = Method::post;
  echo.path = "/v1/things/{id}";
  echo.operation_id = "changeThing";
  echo.parameters = {{.name = "limit", .type = Parameter::Type::integer, .minimum = 1, .maximum = 10}};
  echo.request_schema = "thing";
  echo.run = Run::io;
  echo.handler = [](const Request& request) -> Result<Response> { return json_response(request.body); };
  Endpoint stream;
  stream.path = "/v1/things";
  stream.operation_id = "getThings";
  stream.csv = true;
  stream.handler = [](const Request&) -> Result<Response> {
    Response response;
    response.stream = generate([left = 3](std::string& out, const std::stop_token&) mutable {
      out += "[1, 2, 3]\n";
      return --left > 0;
    });
    return response;
  };
  Endpoint probe;
  probe.path = "/healthz";
  probe.operation_id = "getHealth";
  probe.run = Run::io;
  probe.handler = [](const Request&) -> Result<Response> { return json_response("{}"); };
  std::vector<Endpoint> rows;
  rows.push_back(std::move(echo));
  rows.push_back(std::move(stream));
  rows.push_back(std::move(probe));
  return rows;
}

std::uint16_t start() {
  static const Router router(table());
  ServerOptions options;
  options.read_timeout = options.write_timeout = options.idle_timeout = std::chrono::milliseconds(500);
  options.max_body_bytes = 4096;
  static const auto server = HttpServer::start(options, router);
  testing::require(server.has_value());
  return (*server)->port();
}

// Sends the bytes in pieces of that size and returns all bytes received until the server closes.
std::string exchange(std::uint16_t port, std::string_view bytes, std::size_t piece) {
  const int connection = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  testing::require(connection >= 0);
  const timeval patience{10, 0};
  setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  const linger reset{1, 0};  // leaves no port in TIME_WAIT
  setsockopt(connection, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  testing::require(connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  while (!bytes.empty()) {
    const ssize_t sent = send(connection, bytes.data(), std::min(piece, bytes.size()), MSG_NOSIGNAL);
    if (sent <= 0) break;  // rejected in the meantime
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  shutdown(connection, SHUT_WR);
  std::string answer;
  for (char buffer[4096];;) {
    const ssize_t got = recv(connection, buffer, sizeof buffer, 0);
    testing::require(got >= 0 || errno == ECONNRESET || errno == ENOTCONN);  // otherwise the server hangs
    if (got <= 0) break;
    answer.append(buffer, static_cast<std::size_t>(got));
  }
  close(connection);
  return answer;
}

}  // namespace

// The first byte is the size of the pieces in which the others are sent on one connection to a real server,
// which must still answer the next connection.
JOULECAST_FUZZ_TARGET(http) {
  static const std::uint16_t port = start();
  if (size == 0) return;
  const std::string_view bytes = testing::as_text(data + 1, size - 1);
  const std::string answer = exchange(port, bytes, std::size_t{4} << (data[0] % 12));
  testing::require(answer.empty() || answer.starts_with("HTTP/1."));
  static unsigned number = 0;
  if (++number % 16 == 0)
    testing::require(
        exchange(port, "GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", 4096)
            .starts_with("HTTP/1.1 200"));
}
