#include "tests/benchmarks/http_load.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

namespace joulecast::benchmarks {
namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void give_up(const char* what, std::string_view text = {}) {
  std::fprintf(stderr, "http: %s %.*s\n", what, static_cast<int>(text.size()), text.data());
  std::abort();
}

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

// A connected socket, or -1.
int connected(std::uint16_t port) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = loopback(port);
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return socket;
  ::close(socket);
  return -1;
}

double quantile(std::vector<float>& values, double q) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return static_cast<double>(*at);
}

}  // namespace

HttpConnection::HttpConnection(std::uint16_t port) : socket_(connected(port)) {
  if (socket_ < 0) give_up("cannot connect");
  const int on = 1;
  ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

HttpConnection::~HttpConnection() {
  ::close(socket_);
}

std::string_view HttpConnection::exchange(const std::string& request) {
  if (::send(socket_, request.data(), request.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(request.size()))
    give_up("cannot send");
  received_.clear();
  std::size_t head = 0, wanted = 0;
  std::array<char, 64 * 1024> bytes;
  while (head == 0 || received_.size() < wanted) {
    const ssize_t got = ::recv(socket_, bytes.data(), bytes.size(), 0);
    if (got <= 0) give_up("connection lost");
    received_.append(bytes.data(), static_cast<std::size_t>(got));
    if (head != 0) continue;
    const std::size_t end = received_.find("\r\n\r\n");
    if (end == std::string::npos) continue;
    head = end + 4;
    constexpr std::string_view field = "Content-Length: ";
    const std::size_t at = received_.find(field);
    if (at == std::string::npos || at > end) give_up("no length in", received_);
    std::size_t length = 0;
    std::from_chars(received_.data() + at + field.size(), received_.data() + end, length);
    wanted = head + length;
  }
  if (received_.compare(0, 10, "HTTP/1.1 2") != 0) give_up("refused:", received_);
  return std::string_view(received_).substr(head);
}

std::uint16_t free_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = loopback(0);
  socklen_t length = sizeof address;
  if (::bind(socket, reinterpret_cast<const sockaddr*>(&address), length) != 0 ||
      ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &length) != 0)
    give_up("no free port");
  ::close(socket);
  return ntohs(address.sin_port);
}

bool can_connect(std::uint16_t port) {
  const int socket = connected(port);
  if (socket >= 0) ::close(socket);
  return socket >= 0;
}

std::string http_request_text(std::string_view target, std::string_view json_body) {
  std::string text = json_body.empty() ? "GET " : "POST ";
  text.append(target).append(" HTTP/1.1\r\nHost: localhost\r\nAccept: */*\r\nUser-Agent: benchmark\r\n");
  if (!json_body.empty()) {
    text.append("Content-Type: application/json\r\nContent-Length: ")
        .append(std::to_string(json_body.size()));
    text.append("\r\n");
  }
  return text.append("\r\n").append(json_body);
}

LoadFigures load_http(std::uint16_t port, const std::string& request, double seconds) {
  constexpr std::size_t clients = 8;
  const auto began = Clock::now();
  const auto end =
      began + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  std::vector<std::vector<float>> times(clients);
  std::vector<std::thread> threads;
  for (auto& mine : times) {
    threads.emplace_back([&] {
      HttpConnection connection(port);
      for (auto begin = Clock::now(); begin < end;) {
        connection.exchange(request);
        const auto now = Clock::now();
        mine.push_back(std::chrono::duration<float, std::milli>(now - begin).count());
        begin = now;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();
  std::vector<float> all;
  for (const auto& each : times) all.insert(all.end(), each.begin(), each.end());
  return {static_cast<double>(all.size()) / wall_s, quantile(all, 0.5), quantile(all, 0.99)};
}

}  // namespace joulecast::benchmarks
