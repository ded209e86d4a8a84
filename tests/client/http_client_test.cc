#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <string>
#include <thread>
#include <utility>

#include "client/commands/server_answer.h"

namespace joulecast::client {
namespace {

using namespace std::chrono_literals;

// Accepts one connection, stores the request and returns the given bytes; with an empty answer it stays
// silent.
class OneAnswer {
 public:
  explicit OneAnswer(std::string answer) : answer_(std::move(answer)) {
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), length), 0);
    EXPECT_EQ(::listen(listener_, 1), 0);
    EXPECT_EQ(::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ~OneAnswer() {
    if (thread_.joinable()) thread_.join();
    ::close(listener_);
  }

  http_client::ServerAddress address() const { return {"127.0.0.1", std::to_string(port_), ""}; }
  std::string url() const { return "127.0.0.1:" + std::to_string(port_); }
  // The request; waits until the exchange is over.
  const std::string& request() {
    thread_.join();
    return request_;
  }

 private:
  void serve() {
    const int peer = ::accept(listener_, nullptr, nullptr);
    char buffer[4096];
    for (;;) {
      const auto got = ::recv(peer, buffer, sizeof buffer, 0);
      if (got <= 0) break;
      request_.append(buffer, static_cast<std::size_t>(got));
      if (!answer_.empty() && !answered_ && complete()) {
        answered_ = true;
        EXPECT_EQ(::send(peer, answer_.data(), answer_.size(), MSG_NOSIGNAL),
                  static_cast<ssize_t>(answer_.size()));
      }
    }
    ::close(peer);
  }

  bool complete() const {
    const auto head = request_.find("\r\n\r\n");
    if (head == std::string::npos) return false;
    const auto field = request_.find("Content-Length: ");
    const std::size_t body = field == std::string::npos ? 0 : std::stoul(request_.substr(field + 16));
    return request_.size() >= head + 4 + body;
  }

  std::string answer_;
  std::string request_;
  std::thread thread_;
  int listener_ = -1;
  int port_ = 0;
  bool answered_ = false;
};

TEST(ServerUrl, SplitsHostPortAndPath) {
  const auto full = http_client::parse_url("http://fleet.example:8080/joulecast/", "--server");
  ASSERT_TRUE(full);
  EXPECT_EQ(full->host, "fleet.example");
  EXPECT_EQ(full->port, "8080");
  EXPECT_EQ(full->base_path, "/joulecast");
  const auto bare = http_client::parse_url("http://localhost", "--server");
  ASSERT_TRUE(bare);
  EXPECT_EQ(bare->port, "80");
  EXPECT_EQ(bare->base_path, "");
  const auto plain = http_client::parse_url("localhost:8080", "--server");
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain->host + '|' + plain->port, "localhost|8080");
  const auto six = http_client::parse_url("http://[::1]:99", "--server");
  ASSERT_TRUE(six);
  EXPECT_EQ(six->host, "::1");
  EXPECT_EQ(six->port, "99");
  EXPECT_FALSE(six->tls);
  const auto secure = http_client::parse_url("https://fleet.example/joulecast", "--server");
  ASSERT_TRUE(secure);
  EXPECT_TRUE(secure->tls);
  EXPECT_EQ(secure->host + '|' + secure->port, "fleet.example|443");
  for (const char* wrong : {"https://", "ftp://x", "http://", "http://:80", "http://h:", "http://h:99999",
                            "http://h:8o", "http://user:hunter2@h", "http://h?hunter2"}) {
    const auto refused = http_client::parse_url(wrong, "--server");
    ASSERT_FALSE(refused) << wrong;
    EXPECT_EQ(describe(refused.error()).find("hunter2"), std::string::npos) << "a secret";
  }
}

TEST(HttpClient, SendsBodyAndReadsReply) {
  OneAnswer server(
      "HTTP/1.1 201 Created\r\nContent-Type: application/json\r\nContent-Length: 8\r\n\r\n{\"a\": 1}");
  const auto reply =
      http_request(server.url(), HttpMethod::put, "/v1/robots/r1", "{\"robot_id\":\"r1\"}", 2s);
  ASSERT_TRUE(reply) << describe(reply.error());
  EXPECT_EQ(reply->status, 201u);
  EXPECT_TRUE(reply->ok());
  EXPECT_EQ(reply->content_type, "application/json");
  EXPECT_EQ(reply->body, "{\"a\": 1}");
  const std::string& sent = server.request();
  EXPECT_EQ(sent.rfind("PUT /v1/robots/r1 HTTP/1.1\r\n", 0), 0u) << sent;
  EXPECT_TRUE(sent.ends_with("\r\n\r\n{\"robot_id\":\"r1\"}")) << sent;
}

TEST(HttpClient, ProblemsKeepFaultAndText) {
  OneAnswer server(
      "HTTP/1.1 404 Not Found\r\nContent-Type: application/problem+json\r\nContent-Length: 47\r\n\r\n"
      "{\"title\": \"no such robot\", \"detail\": \"r9 is none\"}");
  const auto reply = http_request(server.url(), HttpMethod::get, "/v1/robots/r9", "", 2s);
  ASSERT_TRUE(reply);
  EXPECT_FALSE(reply->ok());
  EXPECT_EQ(error_of(*reply).fault, Fault::not_found);
}

TEST(HttpClient, StatusesBecomeFaults) {
  EXPECT_EQ(error_of({422, "", "", ""}).fault, Fault::invalid);
  EXPECT_EQ(error_of({409, "", "", ""}).fault, Fault::conflict);
  EXPECT_EQ(error_of({413, "", "", ""}).fault, Fault::too_large);
  EXPECT_EQ(error_of({429, "", "", ""}).fault, Fault::unavailable);
  EXPECT_EQ(error_of({503, "", "", ""}).fault, Fault::unavailable);
  EXPECT_EQ(error_of({400, "", R"({"title":"bad","detail":"speed"})", ""}).message,
            "the server answered 400: bad: speed");
  // A fault of a field is reported like one found by the client.
  const Error of_field =
      error_of({422, "", R"({"type":"urn:joulecast:problem:infeasible","title":"Unprocessable",
      "detail":"/a: must be 1","field":"/a","constraint":"must be 1"})",
                ""});
  EXPECT_EQ(of_field.fault, Fault::infeasible);
  EXPECT_EQ(describe(of_field), "/a: must be 1 (the server answered 422)");
}

TEST(HttpClient, SilenceAndAbsenceAreUnavailable) {
  const auto before = std::chrono::steady_clock::now();
  {
    OneAnswer silent("");
    const auto reply = http_request(silent.url(), HttpMethod::get, "/", "", 200ms);
    ASSERT_FALSE(reply);
    EXPECT_EQ(reply.error().fault, Fault::unavailable);
  }
  EXPECT_LT(std::chrono::steady_clock::now() - before, 5s);
  std::string closed;
  {
    OneAnswer gone("x");
    closed = gone.url();
    // Open and close the one connection so that the listener ends.
    (void)http_request(closed, HttpMethod::get, "/", "", 200ms);
  }
  const auto refused = http_request(closed, HttpMethod::get, "/", "", 2s);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::unavailable);
}

// The peer declares a body that it never sends.
TEST(HttpClient, ReceivesStatusOnly) {
  OneAnswer server("HTTP/1.1 204 Done\r\nContent-Length: 250000000\r\n\r\nbegin");
  const auto reply = http_client::exchange(
      server.address(), {.method = HttpMethod::post, .target = "/", .json_body = "{}", .status_only = true},
      5s);
  ASSERT_TRUE(reply) << describe(reply.error());
  EXPECT_EQ(reply->status, 204U);
  EXPECT_EQ(reply->body, "");
}

TEST(ServerAnswer, EscapesControlsForTerminals) {
  EXPECT_EQ(without_controls("a\tb\r\n\xC3\xA4 \xE2\x82\xAC\n"), "a\tb\r\n\xC3\xA4 \xE2\x82\xAC\n");
  EXPECT_EQ(without_controls("\x1B[2J \xC2\x9B"
                             "2J \x07\x7F \r"),
            "\\u001b[2J \\u009b2J \\u0007\\u007f \\u000d");
}

std::string page_of(const Json& missions) {
  const std::string body = Json{{"missions", missions}}.dump();
  return "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: " +
         std::to_string(body.size()) + "\r\n\r\n" + body;
}

std::string url_of(const OneAnswer& server) {
  return "http://127.0.0.1:" + server.address().port;
}

TEST(MissionNumber, ReturnsNumberUnchanged) {
  EXPECT_EQ(mission_number("http://127.0.0.1:1", "17"), "17");
}

TEST(MissionNumber, FindsMissionById) {
  OneAnswer server(page_of({{{"id", 5}, {"mission_id", "amr m1"}}}));
  EXPECT_EQ(mission_number(url_of(server), "amr m1"), "5");
  const std::string& sent = server.request();
  EXPECT_TRUE(sent.starts_with("GET /v1/missions?mission_id=amr%20m1&limit=2 ")) << sent;
}

TEST(MissionNumber, RejectsUnknownAndAmbiguousIds) {
  OneAnswer none(page_of(Json::array())), two(page_of({{{"id", 5}}, {{"id", 9}}}));
  const auto unknown = mission_number(url_of(none), "m1"), ambiguous = mission_number(url_of(two), "m1");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().fault, Fault::not_found);
  ASSERT_FALSE(ambiguous);
  EXPECT_EQ(ambiguous.error().fault, Fault::conflict);
  EXPECT_EQ(ambiguous.error().message, "5 and 9 have the id m1: give the number of one");
}

}  // namespace
}  // namespace joulecast::client
