// Faulty and hostile clients of the HTTP server, over raw sockets.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <future>
#include <mutex>
#include <thread>
#include <vector>

#include "raw_client.h"
#include "server/http/http_server.h"
#include "server/http/problem.h"

namespace joulecast::http {
namespace {

using namespace std::chrono_literals;
using test::get_text;
using test::post_text;
using test::RawClient;
using test::RawReply;
using Steady = std::chrono::steady_clock;

constexpr const char* other_peer = "127.0.0.2";

class Recorder : public ServerObserver {
 public:
  void refused(Refusal refusal) override { ++refusals[static_cast<std::size_t>(refusal)]; }
  int count(Refusal refusal) const { return refusals[static_cast<std::size_t>(refusal)]; }
  std::array<std::atomic<int>, static_cast<std::size_t>(Refusal::count_)> refusals{};
};

template <class Condition>
bool soon(Condition condition, std::chrono::milliseconds time = 3000ms) {
  const auto end = Steady::now() + time;
  while (!condition()) {
    if (Steady::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

class HttpAttackTest : public ::testing::Test {
 protected:
  HttpAttackTest() : router_(table(), {}, guard) {}
  ~HttpAttackTest() override {
    release();
    if (server_) server_->stop(2s);
  }

  std::vector<Endpoint> table() {
    std::vector<Endpoint> rows;
    const auto row = [&](Method method, std::string path, http::Run run, Handler handler) {
      Endpoint endpoint;
      endpoint.method = method;
      endpoint.path = path;
      endpoint.operation_id = path;
      endpoint.run = run;
      endpoint.handler = std::move(handler);
      rows.push_back(std::move(endpoint));
    };
    const Handler fine = [](const Request&) -> Result<Response> { return json_response("\"fine\""); };
    row(Method::get, "/io", http::Run::io, fine);
    row(Method::get, "/read", http::Run::worker, fine);
    row(Method::get, "/ready", http::Run::operations, fine);
    rows.back().reserved = true;
    row(Method::get, "/who", http::Run::io, [](const Request& request) -> Result<Response> {
      return json_response(request.address + (request.secure ? " secure" : ""));
    });
    row(Method::post, "/who", http::Run::worker, [](const Request& request) -> Result<Response> {
      return json_response(request.address + " " + request.body + " " +
                           std::to_string(request.headers.size()));
    });
    row(Method::post, "/length", http::Run::worker, [](const Request& request) -> Result<Response> {
      return json_response(std::to_string(request.body.size()));
    });
    const Handler thread = [](const Request& request) -> Result<Response> {
      return json_response(std::to_string(std::hash<std::thread::id>{}(std::this_thread::get_id())) +
                           (request.json ? " parsed" : ""));
    };
    row(Method::get, "/thread", http::Run::io, thread);
    for (const auto& [path, run] : {std::pair{"/sign-in", http::Run::io}, {"/profile", http::Run::compute}}) {
      row(Method::post, path, run, thread);
      rows.back().request_schema = "any";
    }
    rows.back().brief = [thread](Request& request) { return *thread(request); };
    rows[rows.size() - 2].max_body_bytes = 4096;
    // Computes until it is stopped or released; checks its stop token as planning does.
    row(Method::get, "/compute", http::Run::compute, [this](const Request& request) -> Result<Response> {
      ++begun_;
      while (!released_ && !request.stop.stop_requested()) std::this_thread::sleep_for(1ms);
      if (request.stop.stop_requested()) ++stopped_;
      return json_response("\"computed\"");
    });
    // Ignores its stop token.
    row(Method::get, "/deaf", http::Run::compute, [this](const Request&) -> Result<Response> {
      ++begun_;
      while (!released_) std::this_thread::sleep_for(1ms);
      return json_response("\"computed\"");
    });
    row(Method::put, "/write", http::Run::write, [this](const Request& request) -> Result<Response> {
      ++begun_;
      while (!released_) std::this_thread::sleep_for(1ms);
      if (request.stop.stop_requested()) ++stopped_;
      return json_response("\"written\"");
    });
    row(Method::get, "/endless", http::Run::compute, [](const Request&) -> Result<Response> {
      Response response;
      response.stream = generate([](std::string& out, const std::stop_token&) {
        std::this_thread::sleep_for(20ms);
        out += "x";
        return true;
      });
      return response;
    });
    return rows;
  }

  // Authorization identifies the client; "wrong" is rejected.
  static std::optional<Response> guard(const Endpoint&, Request& request) {
    const std::string_view token = request.header("authorization");
    request.actor = token;
    if (token != "wrong") return std::nullopt;
    return problem(401, "unauthorized", "This needs another token", request.id);
  }

  void start(const ServerOptions& given = {}) {
    ServerOptions options = given;
    if (options.allowed_hosts.empty()) options.allowed_hosts = {"test"};
    auto server = HttpServer::start(options, router_, &recorder_);
    ASSERT_TRUE(server.has_value()) << describe(server.error());
    server_ = std::move(*server);
  }
  std::uint16_t port() const { return server_->port(); }
  void release() { released_ = true; }

  RawReply ask(const std::string& text, const char* source = nullptr) {
    RawClient client(port(), 0, source);
    client.send(text);
    return client.reply();
  }
  // All replies of the server to these bytes, until it closes the connection as expected.
  std::string all_of(std::string_view bytes) {
    RawClient client(port());
    client.send(bytes);
    std::string text = client.read_to_end();
    EXPECT_TRUE(client.closed_within(100ms)) << bytes;
    return text;
  }

  std::atomic<bool> released_{false};
  std::atomic<int> begun_{0};
  std::atomic<int> stopped_{0};
  Recorder recorder_;
  Router router_;
  std::unique_ptr<HttpServer> server_;
};

int replies_in(std::string_view text) {
  int count = 0;
  for (std::size_t at = text.find("HTTP/1.1 "); at != std::string_view::npos;
       at = text.find("HTTP/1.1 ", at + 1))
    ++count;
  return count;
}

TEST_F(HttpAttackTest, RejectsUnknownTransferEncodings) {
  start();
  const std::string smuggled = get_text("/io");
  int refused = 0;
  for (const char* lines :
       {"Transfer-Encoding: xchunked\r\n", "Transfer-Encoding: gzip\r\n", "Transfer-Encoding: identity\r\n",
        "Transfer-Encoding: chunked, identity\r\n", "Transfer-Encoding: gzip, chunked\r\n",
        "Transfer-Encoding: chunked, chunked\r\n", "Transfer-Encoding: chunked;q=1\r\n",
        "Transfer-Encoding:\r\n", "Transfer-Encoding: \"chunked\"\r\n",
        "Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n",
        "Transfer-Encoding: identity\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nContent-Length: 5\r\n",
        "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
        "Content-Length: 5\r\nTransfer-Encoding: xchunked\r\n", "Content-Length: 5\r\nContent-Length: 6\r\n",
        "Content-Length: 5, 5\r\n", "Content-Length: 5\r\nContent-Length: 5\r\n", "Content-Length: +5\r\n",
        "Transfer-Encoding : chunked\r\n"}) {
    for (const char* start_line : {"POST /length HTTP/1.1\r\n", "GET /io HTTP/1.1\r\n"}) {
      const std::string said =
          all_of(std::string(start_line) + "Host: test\r\n" + lines + "\r\n0\r\n\r\n" + smuggled);
      EXPECT_TRUE(said.starts_with("HTTP/1.1 400 ")) << lines << said;
      EXPECT_EQ(replies_in(said), 1) << lines << said;
      ++refused;
    }
  }
  EXPECT_EQ(recorder_.count(Refusal::malformed), refused);
  // HTTP/1.0 has no chunked coding: a 1.0 proxy would read another body.
  EXPECT_EQ(replies_in(all_of("POST /length HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n")), 1);
  EXPECT_EQ(
      ask("POST /length HTTP/1.1\r\nHost: test\r\nTransfer-Encoding: Chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n")
          .body,
      "3");
}

TEST_F(HttpAttackTest, HeaderLimitIsExact) {
  constexpr std::size_t limit = 16 * 1024;
  start({.max_header_bytes = limit});
  const auto head_of = [](std::size_t size) {
    const std::size_t bare = get_text("/io", "X-A: \r\nX-B: \r\n").size();
    const std::size_t fill = size - bare;
    return get_text("/io", "X-A: " + std::string(fill / 2, 'x') +
                               "\r\nX-B: " + std::string(fill - fill / 2, 'x') + "\r\n");
  };
  for (const auto& [size, status] : {std::pair{limit, 200U}, {limit + 1, 431U}, {23'900UL, 431U}}) {
    const std::string head = head_of(size);
    ASSERT_EQ(head.size(), size);
    EXPECT_EQ(ask(head).status, status) << size;
    EXPECT_EQ(ask(head + "trailing bytes").status, status) << size;
    RawClient slow(port());
    for (std::size_t at = 0; at < head.size(); at += 1000) {
      slow.send(std::string_view(head).substr(at, 1000));
      std::this_thread::sleep_for(1ms);
    }
    EXPECT_EQ(slow.reply().status, status) << size;
  }
}

TEST_F(HttpAttackTest, RejectsForeignHostNames) {
  start({.allowed_hosts = {"fleet.example"}});
  const auto host = [&](const std::string& name) {
    return ask("GET /io HTTP/1.1\r\nHost: " + name + "\r\n\r\n").status;
  };
  for (const char* own : {"localhost", "LOCALHOST:8080", "localhost.:80", "127.0.0.1:8080", "10.1.2.3",
                          "[::1]:8080", "[fe80::1]", "fleet.example", "Fleet.Example:443"})
    EXPECT_EQ(host(own), 200U) << own;
  for (const char* foreign :
       {"rebind.example", "rebind.example:8080", "localhost.evil.example", "127.0.0.1.evil.example",
        "evil.example:127.0.0.1", "", "fleet.example.evil", "localhost@evil.example", "[evil.example]",
        "[::1]evil.example", "[::1].evil.example:80", "[::1"})
    EXPECT_EQ(host(foreign), 421U) << foreign;
  const auto target = [&](const std::string& authority) {
    return ask("GET http://" + authority + "/io HTTP/1.1\r\nHost: localhost\r\n\r\n").status;
  };
  EXPECT_NE(target("localhost:8080"), 421U);
  for (const char* foreign : {"rebind.example", "rebind.example:8080", "[::1]evil.example"})
    EXPECT_EQ(target(foreign), 421U) << foreign;
  EXPECT_EQ(ask("GET /io HTTP/1.1\r\nHost: \r\n\r\n").headers.at("content-type"), "application/problem+json");
  EXPECT_GE(recorder_.count(Refusal::host), 9);
}

TEST_F(HttpAttackTest, RejectsRepeatedAuthorization) {
  start();
  EXPECT_EQ(ask(get_text("/io", "Authorization: Bearer a\r\n")).status, 200U);
  EXPECT_EQ(ask(get_text("/io", "Authorization: Bearer a\r\nauthorization: Bearer b\r\n")).status, 400U);
}

TEST_F(HttpAttackTest, WildcardAllowsAnyHost) {
  start({.allowed_hosts = {"*"}});
  EXPECT_EQ(ask("GET /io HTTP/1.1\r\nHost: whatever.example\r\n\r\n").status, 200U);
}

TEST_F(HttpAttackTest, RejectsWritesOfForeignOrigins) {
  start();
  const auto post = [&](const std::string& origin) {
    return ask(post_text("/length", "[]", "Origin: " + origin + "\r\n")).status;
  };
  EXPECT_EQ(post("http://test"), 200U);
  EXPECT_EQ(post("https://TEST"), 200U);
  for (const char* foreign :
       {"http://evil.example", "null", "http://test:8081", "http://test.evil", "test", "http://"})
    EXPECT_EQ(post(foreign), 403U) << foreign;
  EXPECT_EQ(ask(get_text("/io", "Origin: http://evil.example\r\n")).status, 200U);
  EXPECT_EQ(ask("PUT /write HTTP/1.1\r\nHost: test\r\nOrigin: http://evil.example\r\n\r\n").status, 403U);
  EXPECT_EQ(begun_, 0);
}

TEST_F(HttpAttackTest, RejectsConditionsOfChanges) {
  start();
  for (const char* condition :
       {"If-Match: \"x\"\r\n", "If-Match: *\r\n", "If-Unmodified-Since: Sat, 29 Oct 1994 19:43:31 GMT\r\n"}) {
    EXPECT_EQ(ask(std::string("PUT /write HTTP/1.1\r\nHost: test\r\n") + condition + "\r\n").status, 412U);
    EXPECT_EQ(ask(get_text("/io", condition)).status, 200U);
  }
  EXPECT_EQ(begun_, 0);
}

TEST_F(HttpAttackTest, AcceptsAllowedOrigins) {
  start({.allowed_origins = {"https://fleet.example"}});
  const auto preflight =
      ask("OPTIONS /length HTTP/1.1\r\nHost: test\r\nOrigin: https://fleet.example\r\n"
          "Access-Control-Request-Method: POST\r\n\r\n");
  EXPECT_EQ(preflight.status, 204U);
  EXPECT_EQ(preflight.headers.at("access-control-allow-origin"), "https://fleet.example");
  EXPECT_NE(preflight.headers.at("access-control-allow-methods").find("POST"), std::string::npos);
  const auto posted = ask(post_text("/length", "[]", "Origin: https://fleet.example\r\n"));
  EXPECT_EQ(posted.status, 200U);
  EXPECT_EQ(posted.headers.at("access-control-allow-origin"), "https://fleet.example");
  EXPECT_FALSE(posted.headers.contains("access-control-allow-credentials"));
  EXPECT_EQ(ask(post_text("/length", "[]", "Origin: http://fleet.example\r\n")).status, 403U);
  EXPECT_FALSE(ask(get_text("/io", "Origin: http://evil.example\r\n"))
                   .headers.contains("access-control-allow-origin"));
}

TEST_F(HttpAttackTest, SlowClientsDelayNoOther) {
  start({.max_connections = 64, .client_connections = 32, .read_timeout = 500ms});
  std::deque<RawClient> tricklers;
  for (int k = 0; k < 32; ++k) {
    tricklers.emplace_back(port());
    tricklers.back().send("GET /io HTTP/1.1\r\nHost: te");
  }
  const auto begun = Steady::now();
  while (Steady::now() - begun < 400ms) {
    for (RawClient& each : tricklers) each.send("x");
    EXPECT_EQ(ask(get_text("/read"), other_peer).status, 200U);
    EXPECT_EQ(ask(get_text("/ready")).status, 200U);  // from the same address, on a reserved connection
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_TRUE(soon([&] { return recorder_.count(Refusal::read_timeout) == 32; }));
  for (RawClient& each : tricklers) EXPECT_EQ(each.reply().status, 408U);
}

TEST_F(HttpAttackTest, AnswersHalfClosedClients) {
  start();
  for (const char* path : {"/io", "/read", "/ready"}) {
    RawClient client(port());
    client.send(get_text(path) + get_text(path));
    client.end_sending();
    EXPECT_EQ(client.reply().status, 200U) << path;
    EXPECT_EQ(client.reply().status, 200U) << path;
    EXPECT_TRUE(client.closed_within(1s)) << path;
  }
  RawClient client(port());
  client.send(get_text("/compute"));
  ASSERT_TRUE(soon([&] { return begun_ == 1; }));
  client.end_sending();
  EXPECT_EQ(client.reply().status, 499U);
  EXPECT_TRUE(client.closed_within(1s));
  EXPECT_TRUE(soon([&] { return stopped_ == 1; }));
  EXPECT_EQ(recorder_.count(Refusal::departed), 1);
  RawClient within(port());
  within.send("POST /length HTTP/1.1\r\nHost: test\r\nContent-Length: 10\r\n\r\nabc");
  within.end_sending();
  EXPECT_EQ(within.read_to_end(), "");
}

TEST_F(HttpAttackTest, BoundsPipelinedBodies) {
  start();
  release();
  std::string text;
  for (int k = 0; k < 60; ++k) {
    const std::string body(static_cast<std::size_t>(37 * k), 'G');
    if (k % 3 == 0) {
      text += get_text("/compute");
    } else if (k % 3 == 1) {
      text += post_text("/length", body);
    } else {
      char size[8];
      std::snprintf(size, sizeof size, "%zx", body.size());
      text += "POST /length HTTP/1.1\r\nHost: test\r\nTransfer-Encoding: chunked\r\n\r\n" +
              std::string(size) + "\r\n" + body + "\r\n0\r\n\r\n";
    }
  }
  RawClient client(port());
  client.send(text);
  for (int k = 0; k < 60; ++k) {
    const RawReply reply = client.reply();
    ASSERT_EQ(reply.body, k % 3 == 0 ? "\"computed\"" : std::to_string(37 * k)) << k;
  }
}

TEST_F(HttpAttackTest, DisconnectCancelsRequests) {
  start({.compute_threads = 1});
  auto running = std::make_unique<RawClient>(port());
  running->send(get_text("/compute"));
  ASSERT_TRUE(soon([&] { return begun_ == 1; }));
  auto waiting = std::make_unique<RawClient>(port());
  waiting->send(get_text("/compute"));
  std::this_thread::sleep_for(50ms);
  waiting.reset();
  EXPECT_TRUE(soon([&] { return recorder_.count(Refusal::departed) == 1; }));
  running.reset();
  EXPECT_TRUE(soon([&] { return stopped_ == 1; }));
  release();
  EXPECT_EQ(ask(get_text("/compute")).status, 200U);
  EXPECT_EQ(begun_, 2);  // the queued request never began
}

TEST_F(HttpAttackTest, DeadlineBoundsUnresponsiveHandler) {
  start({.compute_threads = 2, .request_deadline = 300ms});
  for (const char* path : {"/compute", "/deaf"}) {
    const auto begun = Steady::now();
    RawClient client(port());
    client.send(get_text(path));
    const RawReply reply = client.reply();
    EXPECT_EQ(reply.status, 503U) << path;
    EXPECT_EQ(reply.headers.at("retry-after"), "1");
    EXPECT_NE(reply.body.find("request_deadline_s"), std::string::npos) << reply.body;
    EXPECT_TRUE(client.closed_within(3s));
    EXPECT_LT(Steady::now() - begun, 1500ms);
  }
  EXPECT_EQ(stopped_, 1);
  EXPECT_EQ(recorder_.count(Refusal::deadline), 2);
  // The deadline covers all pieces of a streamed answer together.
  RawClient stream(port());
  stream.send(get_text("/endless"));
  EXPECT_NE(stream.read_until("\r\n\r\n").find("200 OK"), std::string::npos);
  EXPECT_TRUE(stream.closed_within(2s));
  EXPECT_EQ(recorder_.count(Refusal::deadline), 3);
}

TEST_F(HttpAttackTest, FinishesBegunChanges) {
  start({.request_deadline = 200ms});
  const std::string put = "PUT /write HTTP/1.1\r\nHost: test\r\nContent-Length: 0\r\n\r\n";
  RawClient begun(port());
  begun.send(put);
  ASSERT_TRUE(soon([&] { return begun_ == 1; }));
  EXPECT_EQ(ask(put).status, 503U);  // queued behind the first; not begun after its deadline
  release();
  EXPECT_EQ(begun.reply().body, "\"written\"");
  EXPECT_EQ(begun_, 1);
  EXPECT_EQ(stopped_, 0);
}

TEST_F(HttpAttackTest, ComputingDelaysNoReads) {
  start({.compute_threads = 1, .worker_queue = 4});
  std::deque<RawClient> clients;
  for (int k = 0; k < 8; ++k) {
    clients.emplace_back(port());
    clients.back().send(get_text("/deaf"));
    ASSERT_TRUE(soon([&] { return begun_ == 1; }));
  }
  ASSERT_TRUE(soon([&] { return recorder_.count(Refusal::worker_queue) == 3; }));
  for (const char* path : {"/read", "/ready", "/io"}) {
    const auto sent = Steady::now();
    EXPECT_EQ(ask(get_text(path)).status, 200U) << path;
    EXPECT_LT(Steady::now() - sent, 500ms) << path;
  }
}

TEST_F(HttpAttackTest, LimitsShareOfOneClient) {
  start({.compute_threads = 1, .client_requests = 3});
  std::deque<RawClient> clients;
  for (int k = 0; k < 3; ++k) {
    clients.emplace_back(port());
    clients.back().send(get_text("/compute"));
  }
  RawClient fourth(port());
  RawReply reply;
  ASSERT_TRUE(soon([&] {
    fourth.send(get_text("/read"));
    reply = fourth.reply();
    return reply.status == 429;
  }));
  EXPECT_EQ(reply.headers.at("retry-after"), "1");
  EXPECT_EQ(ask(get_text("/read"), other_peer).status, 200U);
  release();
  for (RawClient& client : clients) EXPECT_EQ(client.reply().status, 200U);
  fourth.send(get_text("/read"));  // on the same connection
  EXPECT_EQ(fourth.reply().status, 200U);
}

TEST_F(HttpAttackTest, UsesForwardedOfTrustedProxies) {
  start({.trusted_proxies = {"127.0.0.1", "10.0.0.9"}});
  const auto who = [&](const std::string& lines, const char* source = nullptr) {
    return ask(get_text("/who", lines), source).body;
  };
  EXPECT_EQ(who(""), "127.0.0.1");
  EXPECT_EQ(who("X-Forwarded-For: 192.0.2.1\r\n", other_peer), "127.0.0.2");
  EXPECT_EQ(who("X-Forwarded-For: 192.0.2.1\r\n"), "192.0.2.1");
  EXPECT_EQ(who("X-Forwarded-For: 198.51.100.1, 192.0.2.1\r\n"), "192.0.2.1")
      << "the first is set by the client";
  EXPECT_EQ(who("X-Forwarded-For: 198.51.100.1\r\nx-forwarded-for: 192.0.2.1,10.0.0.9\r\n"), "192.0.2.1");
  EXPECT_EQ(who("X-Forwarded-For: 192.0.2.1, unknown\r\n"), "127.0.0.1");
  EXPECT_EQ(who("X-Forwarded-For: ::ffff:192.0.2.1\r\nX-Forwarded-Proto: https\r\n"), "192.0.2.1 secure");
  EXPECT_EQ(who("X-Forwarded-Proto: https\r\n", other_peer), "127.0.0.2");
  EXPECT_EQ(HttpServer::start({.trusted_proxies = {"proxy"}}, router_).error().field, "http.trusted_proxies");
}

TEST_F(HttpAttackTest, ProxyClientsHaveOwnLimits) {
  start({.trusted_proxies = {"127.0.0.1"},
         .compute_threads = 1,
         .client_requests = 1,
         .client_connections = 2});
  const auto from = [](const char* path, const std::string& client) {
    return get_text(path, "X-Forwarded-For: " + client + "\r\n");
  };
  RawClient busy(port()), same(port()), another(port());
  busy.send(from("/compute", "192.0.2.1"));
  ASSERT_TRUE(soon([&] { return begun_ == 1; }));
  same.send(from("/read", "192.0.2.1"));
  EXPECT_EQ(same.reply().status, 429U);
  another.send(from("/read", "192.0.2.2"));
  EXPECT_EQ(another.reply().status, 200U) << "third connection of the proxy";
  release();
  EXPECT_EQ(busy.reply().status, 200U);
  same.send(from("/read", "192.0.2.1"));
  EXPECT_EQ(same.reply().status, 200U);
}

TEST_F(HttpAttackTest, ClosesOldestIdleConnections) {
  start({.max_connections = 24, .client_connections = 16});
  RawClient served(port(), 0, other_peer);
  std::deque<RawClient> idle;
  for (int k = 0; k < 60; ++k) {
    idle.emplace_back(port());
    served.send(get_text("/read"));
    ASSERT_EQ(served.reply().status, 200U) << k;
    ASSERT_EQ(ask(get_text("/ready"), other_peer).status, 200U) << k;
  }
  // The peer's oldest connection was closed for its newest.
  EXPECT_TRUE(idle.front().closed_within(1s));
  EXPECT_EQ(recorder_.count(Refusal::evicted), 60 - 16);
  idle.back().send(get_text("/io"));
  EXPECT_EQ(idle.back().reply().status, 200U);
  // With many peers the oldest idle connection of all is closed.
  std::deque<RawClient> others;
  for (int k = 10; k < 30; ++k) {
    others.emplace_back(port(), 0, ("127.0.0." + std::to_string(k)).c_str());
    others.back().send(get_text("/io"));
    ASSERT_EQ(others.back().reply().status, 200U) << k;
  }
}

TEST_F(HttpAttackTest, ClosesUnfinishedRequests) {
  for (const char* begun : {"G", "POST /length HTTP/1.1\r\nHost: test\r\nContent-Length: 9\r\n\r\nabc"}) {
    start({.max_connections = 8, .client_connections = 4});
    std::deque<RawClient> hoarders;
    for (const char* peer : {"127.0.0.1", "127.0.0.2"})
      for (int k = 0; k < 4; ++k) hoarders.emplace_back(port(), 0, peer).send(begun);
    RawClient own(port());
    own.send(get_text("/io"));
    EXPECT_EQ(own.reply().status, 503U) << "over the limit of its address";
    const int before = recorder_.count(Refusal::evicted);
    std::deque<RawClient> others;
    for (int k = 10; k < 14; ++k) {
      others.emplace_back(port(), 0, ("127.0.0." + std::to_string(k)).c_str()).send(get_text("/read"));
      EXPECT_EQ(others.back().reply().status, 200U) << k;
    }
    EXPECT_EQ(recorder_.count(Refusal::evicted) - before, 4);
    int left[2] = {};
    for (std::size_t k = 0; k < hoarders.size(); ++k) left[k / 4] += !hoarders[k].closed_within(10ms);
    EXPECT_EQ(left[0] + left[1], 4);
    EXPECT_GE(std::min(left[0], left[1]), 1) << "the peer with more connections loses one";
    for (RawClient& each : others) {
      each.send(get_text("/read"));
      EXPECT_EQ(each.reply().status, 200U) << "it has fewer connections";
    }
  }
}

TEST_F(HttpAttackTest, ReservesConnectionsForProbes) {
  start({.compute_threads = 2, .max_connections = 2});
  std::deque<RawClient> busy;
  for (int k = 0; k < 2; ++k) {
    busy.emplace_back(port());
    busy.back().send(get_text("/compute"));
  }
  ASSERT_TRUE(soon([&] { return begun_ == 2; }));
  std::deque<RawClient> flood;
  for (int k = 0; k < 150; ++k) {
    flood.emplace_back(port());
    if (k % 2 == 0) flood.back().send("GET /io HTTP/1.1\r\nHo");
    if (k % 10 != 0) continue;
    const RawReply probe = ask(get_text("/ready"));
    ASSERT_EQ(probe.status, 200U) << k;
    EXPECT_EQ(probe.headers.at("connection"), "close");
    ASSERT_EQ(ask(get_text("/io")).status, 503U) << k;
  }
}

// A request with a body that lacks its last byte.
std::string unfinished(std::size_t body, const std::string& lines = {}) {
  return "POST /length HTTP/1.1\r\nHost: test\r\n" + lines + "Content-Length: " + std::to_string(body) +
         "\r\n\r\n" + std::string(body - 1, 'x');
}

TEST_F(HttpAttackTest, UnfinishedBodiesShareBudget) {
  start({.max_body_bytes = 100'000, .max_bodies_bytes = 250'000});
  std::deque<RawClient> hoarders;
  for (const char* peer : {"127.0.0.1", other_peer}) {
    hoarders.emplace_back(port(), 0, peer).send(unfinished(100'000));
    ASSERT_EQ(ask(get_text("/io")).status, 200U);
  }
  RawClient third(port(), 0, "127.0.0.3");
  third.send(unfinished(100'000));
  EXPECT_EQ(third.reply().status, 503U);
  EXPECT_EQ(recorder_.count(Refusal::bodies), 1);
  hoarders[0].send("x");
  EXPECT_EQ(hoarders[0].reply().body, "100000");
  RawClient fourth(port(), 0, "127.0.0.3");
  fourth.send(unfinished(100'000) + "x");
  EXPECT_EQ(fourth.reply().body, "100000");
}

TEST_F(HttpAttackTest, DiscardsLargestUnfinishedBody) {
  start({.max_body_bytes = 100'000, .max_bodies_bytes = 400'000});
  std::deque<RawClient> hoarders;
  for (const char* peer : {"127.0.0.1", "127.0.0.2", "127.0.0.3", "127.0.0.4"})
    for (const std::size_t bytes : {60'000UL, 40'000UL})
      hoarders.emplace_back(port(), 0, peer).send(unfinished(bytes));
  EXPECT_EQ(ask(unfinished(2000) + "x").status, 429U) << "the client already uses its quarter";
  for (const std::string& body :
       {unfinished(2000) + "x", std::string("POST /length HTTP/1.1\r\nHost: test\r\n"
                                            "Transfer-Encoding: chunked\r\n\r\n"
                                            "3\r\nabc\r\n0\r\n\r\n")})
    EXPECT_EQ(ask(body, "127.0.0.5").status, 200U);
  EXPECT_EQ(recorder_.count(Refusal::bodies), 2);
  int cut = 0;
  for (std::size_t k = 0; k < hoarders.size(); ++k)
    if (hoarders[k].closed_within(10ms)) {
      ++cut;
      EXPECT_EQ(k % 2, 0U) << "the smaller body";
    }
  EXPECT_EQ(cut, 1);
}

TEST_F(HttpAttackTest, IdentifiesClientByToken) {
  start({.max_body_bytes = 100'000, .max_bodies_bytes = 400'000});
  RawClient hoarder(port());
  hoarder.send(unfinished(100'000));
  ASSERT_EQ(ask(get_text("/io")).status, 200U);
  EXPECT_EQ(ask(unfinished(2000) + "x").status, 429U);
  EXPECT_EQ(ask(unfinished(2000, "Authorization: mine\r\n") + "x").status, 200U);
  RawClient same(port(), 0, other_peer);
  same.send(unfinished(100'000, "Authorization: mine\r\n"));
  ASSERT_EQ(ask(get_text("/io")).status, 200U);
  EXPECT_EQ(ask(unfinished(2000, "Authorization: mine\r\n") + "x").status, 429U);
}

TEST_F(HttpAttackTest, RejectedRequestsLeaveBodiesUnread) {
  start({.max_body_bytes = 100'000, .max_bodies_bytes = 100'000});
  const auto head = [&](const char* target, std::size_t bytes, const std::string& lines) {
    RawClient client(port());
    client.send("POST " + std::string(target) +
                " HTTP/1.1\r\nHost: test\r\nContent-Length: " + std::to_string(bytes) +
                "\r\nContent-Type: application/json\r\nExpect: 100-continue\r\n" + lines + "\r\n");
    const RawReply reply = client.reply();
    EXPECT_EQ(reply.headers.at("connection"), "close") << target;
    return reply.status;
  };
  EXPECT_EQ(head("/length", 100'000, "Authorization: wrong\r\n"), 401U);
  EXPECT_EQ(head("/length", 200'000, "Authorization: wrong\r\n"), 401U);
  EXPECT_EQ(head("/length", 100'001, ""), 413U);
  EXPECT_EQ(head("/sign-in", 4097, ""), 413U);
  EXPECT_EQ(head("/nowhere", 100'000, ""), 404U);
  EXPECT_EQ(head("/read", 100'000, ""), 405U);
  EXPECT_EQ(ask("POST /sign-in HTTP/1.1\r\nHost: test\r\nContent-Type: application/json\r\n"
                "Transfer-Encoding: chunked\r\n\r\n1001\r\n[")
                .status,
            413U);
  EXPECT_EQ(recorder_.count(Refusal::body_size), 3);
  // Without a body the connection stays open.
  RawClient client(port());
  client.send(get_text("/nowhere") + get_text("/io"));
  EXPECT_EQ(client.reply().status, 404U);
  EXPECT_EQ(client.reply().status, 200U);
}

TEST_F(HttpAttackTest, IgnoresTrailers) {
  start({.trusted_proxies = {"127.0.0.1"}, .max_header_bytes = 4096});
  const std::string head =
      "POST /who HTTP/1.1\r\nHost: test\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n";
  RawClient client(port());
  for (const char* field : {"X-Forwarded-For: 192.0.2.1", "Authorization: wrong", "Host: evil.example",
                            "Origin: http://evil.example", "Connection: close", "X-Request-Id: forged"}) {
    client.send(head + field + "\r\n\r\n");
    const RawReply reply = client.reply();
    EXPECT_EQ(reply.status, 200U) << field;
    EXPECT_EQ(reply.body, "127.0.0.1 abc 2") << field;
    EXPECT_NE(reply.headers.at("x-request-id"), "forged");
  }
  for (const auto& [bytes, status] : {std::pair{3000UL, 200U}, {5000UL, 400U}, {50'000UL, 400U}}) {
    const std::string text = head + "X-Fill: " + std::string(bytes, 'x') + "\r\n\r\n";
    EXPECT_EQ(ask(text).status, status) << bytes;
    RawClient slow(port());
    for (std::size_t at = 0; at < text.size(); at += 1000) {
      slow.send(std::string_view(text).substr(at, 1000));
      std::this_thread::sleep_for(1ms);
    }
    EXPECT_EQ(slow.reply().status, status) << bytes;
  }
  RawClient endless(port());
  endless.send(head);
  for (int k = 0; k < 100; ++k)
    endless.send("X-" + std::to_string(k) + ": " + std::string(100, 'x') + "\r\n");
  EXPECT_EQ(endless.reply().status, 400U);
}

TEST_F(HttpAttackTest, ParsesBodiesOnWorkers) {
  start();
  const std::string io = ask(get_text("/thread")).body;
  for (const char* path : {"/sign-in", "/profile"}) {
    const std::string brief = ask(post_text(path, "[{}]")).body;
    EXPECT_TRUE(brief.ends_with(" parsed")) << brief;
    EXPECT_FALSE(brief.starts_with(io)) << path;
  }
}

TEST_F(HttpAttackTest, StopCancelsComputation) {
  start({.compute_threads = 1});
  std::deque<RawClient> clients;
  for (int k = 0; k < 20; ++k) {
    clients.emplace_back(port());
    clients.back().send(k < 10 ? get_text("/compute") : "GET /io HTTP/1.1\r\nHo");
  }
  ASSERT_TRUE(soon([&] { return begun_ == 1; }));
  const auto begun = Steady::now();
  EXPECT_FALSE(server_->stop(200ms));
  EXPECT_LT(Steady::now() - begun, 1s);
  EXPECT_EQ(begun_, 1);
}

TEST_F(HttpAttackTest, UnresponsiveHandlerDelaysStopBriefly) {
  start();
  RawClient client(port());
  client.send(get_text("/deaf"));
  ASSERT_TRUE(soon([&] { return begun_ == 1; }));
  const auto begun = Steady::now();
  EXPECT_FALSE(server_->stop(200ms));
  EXPECT_LT(Steady::now() - begun, 2500ms);
  EXPECT_TRUE(client.closed_within(100ms));
  EXPECT_FALSE(server_->ended());
  release();
  EXPECT_TRUE(soon([&] { return server_->ended(); }));
}

}  // namespace
}  // namespace joulecast::http
