#include "server/http/http_server.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <future>
#include <latch>
#include <new>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "raw_client.h"
#include "server/http/event_hub.h"

namespace joulecast::http {
namespace {

using namespace std::chrono_literals;
using test::get_text;
using test::post_text;
using test::RawClient;
using test::RawReply;

class Recorder : public ServerObserver {
 public:
  void exchanged(const Exchange& exchange) override {
    last_status = exchange.status;
    streams += exchange.stream;
    ++exchanges;
  }
  void refused(Refusal refusal) override { ++refusals[static_cast<std::size_t>(refusal)]; }
  void connections(std::size_t count) override { open = count; }
  int count(Refusal refusal) const { return refusals[static_cast<std::size_t>(refusal)]; }

  std::atomic<int> exchanges{0}, streams{0};
  std::atomic<unsigned> last_status{0};
  std::atomic<std::size_t> open{0};
  std::array<std::atomic<int>, static_cast<std::size_t>(Refusal::count_)> refusals{};
};

// Waits until another thread makes the condition true.
template <class Condition>
bool soon(Condition condition, std::chrono::milliseconds time = 3000ms) {
#ifdef __SANITIZE_THREAD__
  time *= 6;
#endif
  const auto end = std::chrono::steady_clock::now() + time;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

class HttpServerTest : public ::testing::Test {
 protected:
  HttpServerTest()
      : hub_({.queue_bytes = 32 * 1024, .backlog_bytes = 4096, .heartbeat = 100ms}), router_(table()) {}
  ~HttpServerTest() override {
    release_.set_value();
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
    row(Method::get, "/echo/{text}", http::Run::io, [](const Request& request) -> Result<Response> {
      return json_response("\"" + request.param("text") + "\"");
    });
    rows.back().former_path = "/said/{text}";
    row(Method::get, "/work/{text}", http::Run::worker, [](const Request& request) -> Result<Response> {
      return json_response("\"" + request.param("text") + "\"");
    });
    row(Method::post, "/length", http::Run::worker, [](const Request& request) -> Result<Response> {
      return json_response(std::to_string(request.body.size()));
    });
    row(Method::get, "/blocked", http::Run::worker, [this](const Request&) -> Result<Response> {
      ++blocked_;
      blocking_.wait();
      return json_response("\"released\"");
    });
    row(Method::get, "/forged", http::Run::io, [](const Request&) -> Result<Response> {
      auto response = json_response("1");
      response.headers.emplace_back("X-Value", "a\r\nX-Forged: b");
      return response;
    });
    row(Method::get, "/count", http::Run::io, [](const Request&) -> Result<Response> {
      Response response;
      response.content_type = "text/plain";
      response.stream = generate([n = 0](std::string& out, const std::stop_token&) mutable {
        out += std::to_string(n) + ",";
        return ++n < 100;
      });
      return response;
    });
    row(Method::get, "/endless-count", http::Run::io, [this](const Request&) -> Result<Response> {
      Response response;
      response.stream = generate([this](std::string& out, const std::stop_token& left) {
        if (left.stop_requested()) return false;
        out.append(1000, 'x');
        ++pieces_;
        return true;
      });
      // Destroyed with the stream, which shows that the server has released it.
      alive_ = response.stream;
      return response;
    });
    row(Method::post, "/sometimes-brief", http::Run::worker,
        [](const Request&) -> Result<Response> { return json_response("\"worker\""); });
    rows.back().request_schema = "any";
    rows.back().brief = [](const Request& request) -> std::optional<Response> {
      if (!request.json->at("quick").get<bool>()) return std::nullopt;
      return json_response("\"brief\"");
    };
    row(Method::post, "/read-once", http::Run::worker, [](const Request& request) -> Result<Response> {
      return json_response(std::any_cast<std::string>(request.input));
    });
    rows.back().request_schema = "any";
    rows.back().brief = [](Request& request) -> std::optional<Response> {
      if (!request.input.has_value()) request.input = request.json->at("n").dump();
      return std::nullopt;
    };
    row(Method::get, "/fault", http::Run::io,
        [](const Request&) -> Result<Response> { return fail(Fault::internal, "", "secret cause"); });
    row(Method::get, "/throws", http::Run::worker,
        [](const Request&) -> Result<Response> { throw std::runtime_error("secret cause"); });
    row(Method::get, "/no-memory", http::Run::worker,
        [](const Request&) -> Result<Response> { throw std::bad_alloc(); });
    rows.push_back({.path = "/events",
                    .operation_id = "events",
                    .response_type = "text/event-stream",
                    .run = http::Run::io,
                    .handler = [this](const Request& request) { return hub_.respond(request); }});
    return rows;
  }

  void start(ServerOptions options = {}) {
    if (options.allowed_hosts.empty()) options.allowed_hosts = {"test", "t", "a"};
    auto server = HttpServer::start(options, router_, &recorder_);
    ASSERT_TRUE(server.has_value()) << describe(server.error());
    server_ = std::move(*server);
    ASSERT_NE(server_->port(), 0);
  }
  std::uint16_t port() const { return server_->port(); }

  std::promise<void> release_;
  std::shared_future<void> blocking_{release_.get_future()};
  std::atomic<int> blocked_{0};
  std::atomic<int> pieces_{0};
  std::weak_ptr<StreamSource> alive_;
  EventHub hub_;
  Recorder recorder_;
  Router router_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(HttpServerTest, KeepsConnectionsOpen) {
  start();
  RawClient client(port());
  for (const char* path : {"/echo/a", "/work/b", "/echo/c"}) {
    client.send(get_text(path));
    const RawReply reply = client.reply();
    EXPECT_EQ(reply.status, 200U);
    EXPECT_EQ(reply.body, "\"" + std::string(path).substr(6) + "\"");
    EXPECT_EQ(reply.headers.count("connection"), 0U);
    EXPECT_EQ(reply.headers.at("x-content-type-options"), "nosniff");
    EXPECT_FALSE(reply.headers.at("date").empty());
  }
}

TEST_F(HttpServerTest, MarksFormerPathsDeprecated) {
  start();
  RawClient client(port());
  for (const auto& [path, status] : {std::pair("/said/a", 200U), {"/said/a?b=1", 400U}, {"/echo/a", 200U}}) {
    client.send(get_text(path));
    const RawReply reply = client.reply();
    EXPECT_EQ(reply.status, status) << path;
    EXPECT_EQ(reply.body == "\"a\"", status == 200) << path;
    // A date of RFC 9651: @ and the seconds since 1970.
    const auto found = reply.headers.find("deprecation");
    const bool dated = found != reply.headers.end() && found->second.starts_with("@") &&
                       std::stoll(found->second.substr(1)) > 0;
    EXPECT_EQ(dated, std::string_view(path).starts_with("/said/")) << path;
    EXPECT_EQ(dated, found != reply.headers.end()) << path;
  }
}

TEST_F(HttpServerTest, AnswersPipelinedRequestsInOrder) {
  start();
  RawClient client(port());
  std::string text;
  for (int i = 0; i < 200; ++i) text += get_text((i % 3 == 0 ? "/work/" : "/echo/") + std::to_string(i));
  client.send(text);
  for (int i = 0; i < 200; ++i) {
    const RawReply reply = client.reply();
    ASSERT_EQ(reply.body, "\"" + std::to_string(i) + "\"");
  }
}

TEST_F(HttpServerTest, ReadsRequestsByteByByte) {
  start();
  RawClient client(port());
  for (const char byte : post_text("/length", "[1,2,3]")) {
    client.send(std::string_view(&byte, 1));
  }
  EXPECT_EQ(client.reply().body, "7");
}

TEST_F(HttpServerTest, ReadsChunkedBodies) {
  start();
  RawClient client(port());
  client.send(
      "POST /length HTTP/1.1\r\nHost: t\r\nTransfer-Encoding: "
      "chunked\r\n\r\n3\r\nabc\r\n4\r\ndefg\r\n0\r\n\r\n");
  EXPECT_EQ(client.reply().body, "7");
}

TEST_F(HttpServerTest, RejectsAmbiguousFraming) {
  start();
  RawClient client(port());
  client.send(
      "POST /length HTTP/1.1\r\nHost: t\r\nContent-Length: 4\r\nTransfer-Encoding: "
      "chunked\r\n\r\n0\r\n\r\nGET /echo/smuggled HTTP/1.1\r\nHost: t\r\n\r\n");
  const RawReply reply = client.reply();
  EXPECT_EQ(reply.status, 400U) << reply.head << reply.body;
  EXPECT_TRUE(client.closed_within(3s));
}

TEST_F(HttpServerTest, SendsContinueToWaitingClients) {
  start();
  RawClient client(port());
  client.send("POST /length HTTP/1.1\r\nHost: t\r\nContent-Length: 3\r\nExpect: 100-continue\r\n\r\n");
  EXPECT_EQ(client.reply().status, 100U);
  client.send("abc");
  EXPECT_EQ(client.reply().body, "3");
}

TEST_F(HttpServerTest, AnswersHeadWithLength) {
  start();
  RawClient client(port());
  client.send("HEAD /echo/abc HTTP/1.1\r\nHost: t\r\n\r\n" + get_text("/echo/next"));
  const RawReply reply = client.reply(true);
  EXPECT_EQ(reply.status, 200U);
  EXPECT_EQ(reply.headers.at("content-length"), "5");
  EXPECT_EQ(client.reply().body, "\"next\"");
}

TEST_F(HttpServerTest, ClosesOnRequest) {
  start();
  RawClient client(port());
  client.send(get_text("/echo/a", "Connection: close\r\n"));
  EXPECT_EQ(client.reply().headers.at("connection"), "close");
  EXPECT_TRUE(client.closed_within(2s));
}

TEST_F(HttpServerTest, SupportsHttp10) {
  start();
  RawClient client(port());
  client.send("GET /echo/a HTTP/1.0\r\n\r\n");
  EXPECT_EQ(client.reply().body, "\"a\"");
  EXPECT_TRUE(client.closed_within(2s));
}

TEST_F(HttpServerTest, RejectsMalformedRequests) {
  start();
  for (const auto& [text, status] : std::vector<std::pair<std::string, unsigned>>{
           {"GET /echo/a HTTP/1.1\r\n\r\n", 400},  // no Host
           {"GET /echo/a HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400},
           {"nonsense\r\n\r\n", 400},
           {"GET /echo/a HTTP/3.7\r\nHost: a\r\n\r\n", 505},
           {"POST /length HTTP/1.1\r\nHost: t\r\nContent-Length: -4\r\n\r\n", 400},
           {"POST /length HTTP/1.1\r\nHost: t\r\nContent-Length: 1\r\nExpect: miracles\r\n\r\n", 417}}) {
    RawClient client(port());
    client.send(text);
    const RawReply reply = client.reply();
    EXPECT_EQ(reply.status, status) << text;
    EXPECT_EQ(reply.headers.at("content-type"), "application/problem+json");
    EXPECT_TRUE(client.closed_within(2s)) << text;
  }
  EXPECT_EQ(recorder_.count(Refusal::malformed), 6);
}

TEST_F(HttpServerTest, LimitsHeaderSize) {
  start({.max_header_bytes = 1024});
  RawClient fits(port());
  fits.send(get_text("/echo/a", "X-Fill: " + std::string(900, 'x') + "\r\n"));
  EXPECT_EQ(fits.reply().status, 200U);
  RawClient client(port());
  client.send(get_text("/echo/a", "X-Fill: " + std::string(200'000, 'x') + "\r\n"));
  EXPECT_EQ(client.reply().status, 431U);
  EXPECT_TRUE(client.closed_within(3s));
  EXPECT_EQ(recorder_.count(Refusal::header_size), 1);
}

TEST_F(HttpServerTest, LimitsBodySize) {
  start({.max_body_bytes = 2048});
  RawClient fits(port());
  fits.send(post_text("/length", std::string(2048, '1')));
  EXPECT_EQ(fits.reply().body, "2048");
  // The whole body is in flight when the request is rejected; the answer must still reach the client.
  RawClient declared(port());
  declared.send(post_text("/length", std::string(500'000, '1')));
  EXPECT_EQ(declared.reply().status, 413U);
  RawClient chunked(port());
  chunked.send(
      "POST /length HTTP/1.1\r\nHost: t\r\nTransfer-Encoding: chunked\r\n\r\n"
      "1000\r\n" +
      std::string(4096, 'x'));
  EXPECT_EQ(chunked.reply().status, 413U);
  EXPECT_EQ(recorder_.count(Refusal::body_size), 2);
}

TEST_F(HttpServerTest, EndsSlowRequests) {
  start({.read_timeout = 300ms});
  RawClient client(port());
  const auto begin = std::chrono::steady_clock::now();
  client.send("GET /echo/a HTTP/1.1\r\n");
  // A header every 0.1 s does not extend the limit, which is on the whole request.
  std::thread trickle([&] {
    for (int i = 0; i < 5; ++i) {
      std::this_thread::sleep_for(100ms);
      client.send("X-" + std::to_string(i) + ": 1\r\n");
    }
  });
  EXPECT_EQ(client.reply().status, 408U);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 1500ms);
  trickle.join();
  EXPECT_EQ(recorder_.count(Refusal::read_timeout), 1);
}

TEST_F(HttpServerTest, ClosesIdleConnections) {
  start({.idle_timeout = 200ms});
  RawClient client(port());
  client.send(get_text("/echo/a"));
  EXPECT_EQ(client.reply().status, 200U);
  EXPECT_TRUE(client.closed_within(2s));
}

TEST_F(HttpServerTest, RejectsConnectionsAboveLimit) {
  start({.max_connections = 2});
  RawClient first(port());
  RawClient second(port());
  first.send(get_text("/blocked"));
  second.send(get_text("/blocked"));
  ASSERT_TRUE(soon([&] { return blocked_ == 2; }));
  RawClient third(port());
  third.send(get_text("/echo/a"));
  const RawReply reply = third.reply();
  EXPECT_EQ(reply.status, 503U);
  EXPECT_EQ(reply.headers.at("retry-after"), "1");
  EXPECT_EQ(recorder_.count(Refusal::connections), 1);
  release_.set_value();
  EXPECT_EQ(first.reply().status, 200U);
  EXPECT_EQ(second.reply().status, 200U);
  release_ = {};
  first.close();
  third.close();
  ASSERT_TRUE(soon([&] { return recorder_.open == 1; }));
  RawClient fourth(port());
  fourth.send(get_text("/echo/a"));
  EXPECT_EQ(fourth.reply().status, 200U);
}

TEST_F(HttpServerTest, RejectsWorkAboveQueueLimit) {
  start({.worker_threads = 1, .worker_queue = 1});
  RawClient running(port());
  running.send(get_text("/blocked"));
  ASSERT_TRUE(soon([&] { return blocked_ == 1; }));
  RawClient waiting(port());
  waiting.send(get_text("/blocked"));
  RawClient io(port());
  // The I/O thread answers in order of arrival: after this answer the request above is queued, unless it is
  // still in flight, which repeating excludes.
  RawReply refused;
  ASSERT_TRUE(soon([&] {
    io.send(get_text("/work/a"));
    refused = io.reply();
    return refused.status == 503;
  }));
  EXPECT_EQ(refused.headers.at("retry-after"), "1");
  io.send(get_text("/echo/still-alive"));
  EXPECT_EQ(io.reply().status, 200U);
  EXPECT_GE(recorder_.count(Refusal::worker_queue), 1);
}

TEST_F(HttpServerTest, AnswersBriefRequestsDirectly) {
  start({.worker_threads = 1, .worker_queue = 1});
  const auto ask = [](RawClient& client, const std::string& body) {
    client.send(post_text("/sometimes-brief", body, "Content-Type: application/json\r\n"));
    return client.reply();
  };
  RawClient client(port());
  EXPECT_EQ(ask(client, R"({"quick": true})").body, "\"brief\"");
  EXPECT_EQ(ask(client, R"({"quick": false})").body, "\"worker\"");
  EXPECT_EQ(ask(client, R"({"quick": 1})").body, "\"worker\"");  // the handler reports the exception
  EXPECT_EQ(ask(client, R"({"quick": tr)").status, 400U);
  const std::string much =
      R"({"quick": true, "padding": ")" + std::string(Router::brief_body_bytes, 'x') + "\"}";
  EXPECT_EQ(ask(client, much).body, "\"worker\"");
  RawClient running(port());
  running.send(get_text("/blocked"));
  ASSERT_TRUE(soon([&] { return blocked_ == 1; }));
  EXPECT_EQ(ask(client, R"({"quick": true})").body, "\"brief\"");
}

TEST_F(HttpServerTest, RequestsDoNotShareState) {
  start();
  RawClient client(port());
  for (const char* n : {"1", "2", "3"}) {
    client.send(
        post_text("/read-once", R"({"n": )" + std::string(n) + "}", "Content-Type: application/json\r\n"));
    EXPECT_EQ(client.reply().body, n);
  }
}

TEST_F(HttpServerTest, HidesInternalFaults) {
  start();
  RawClient client(port());
  for (const char* path : {"/fault", "/throws"}) {
    client.send(get_text(path, "X-Request-Id: trace-7\r\n"));
    const RawReply reply = client.reply();
    EXPECT_EQ(reply.status, 500U);
    EXPECT_EQ(reply.headers.at("x-request-id"), "trace-7");
    EXPECT_EQ(nlohmann::json::parse(reply.body).at("request_id"), "trace-7");
    EXPECT_EQ(reply.body.find("secret"), std::string::npos);
  }
  client.send(get_text("/echo/a", "X-Request-Id: <script>\r\n"));
  const std::string own = client.reply().headers.at("x-request-id");
  client.send(get_text("/echo/a"));
  EXPECT_NE(client.reply().headers.at("x-request-id"), own);
  EXPECT_EQ(own.find('<'), std::string::npos);
}

TEST_F(HttpServerTest, WantOfMemoryFailsOneRequest) {
  start();
  RawClient client(port());
  for (int k = 0; k < 3; ++k) {
    client.send(get_text("/no-memory"));
    EXPECT_EQ(client.reply().status, 500U);
    client.send(get_text("/echo/a"));
    EXPECT_EQ(client.reply().status, 200U) << "the same connection, and the worker, go on";
  }
}

TEST_F(HttpServerTest, HeaderValuesCannotForgeHeaders) {
  start();
  RawClient client(port());
  client.send(get_text("/forged"));
  EXPECT_EQ(client.reply().headers.count("x-forged"), 0U);
}

TEST_F(HttpServerTest, StreamingKeepsConnection) {
  start();
  std::string expected;
  for (int i = 0; i < 100; ++i) expected += std::to_string(i) + ",";
  RawClient client(port());
  client.send(get_text("/count"));
  RawReply reply = client.reply();
  EXPECT_EQ(reply.headers.at("transfer-encoding"), "chunked");
  EXPECT_TRUE(reply.complete);
  EXPECT_EQ(reply.body, expected);
  client.send(get_text("/count") + get_text("/echo/after"));  // pipelined behind a stream
  EXPECT_EQ(client.reply().body, expected);
  EXPECT_EQ(client.reply().body, "\"after\"");
  RawClient old(port());
  old.send("GET /count HTTP/1.0\r\n\r\n");
  EXPECT_TRUE(old.read_until("99,").ends_with("98,99,"));
  EXPECT_TRUE(old.closed_within(2s));
}

TEST_F(HttpServerTest, MeasuresAnswersInPieces) {
  start();
  RawClient client(port());
  client.send(get_text("/count"));
  EXPECT_TRUE(client.reply().complete);
  EXPECT_TRUE(soon([&] { return recorder_.exchanges == 1; }));
  EXPECT_EQ(recorder_.streams, 0);
}

TEST_F(HttpServerTest, SlowReaderPausesItsGenerator) {
  start();
  RawClient client(port(), 4096);
  client.send(get_text("/endless-count"));
  ASSERT_TRUE(soon([&] { return pieces_ > 10; }));
  // The generator pauses once the bounded socket buffers are full.
  int before = 0;
  ASSERT_TRUE(soon(
      [&] {
        before = pieces_;
        std::this_thread::sleep_for(100ms);
        return pieces_ == before;
      },
      10s));
  client.close();
  EXPECT_TRUE(soon([&] { return alive_.expired(); }));
}

TEST_F(HttpServerTest, SendsEventsAndHeartbeats) {
  start();
  RawClient client(port());
  client.send(get_text("/events"));
  ASSERT_NE(client.read_until("\r\n\r\n").find("text/event-stream"), std::string::npos);
  ASSERT_TRUE(soon([&] { return hub_.counts().subscribers == 1; }));
  hub_.publish("robot_state", R"({"a":1})");
  const std::string event = client.read_until("\n\n");
  EXPECT_NE(event.find("event: robot_state\nid: "), std::string::npos);
  EXPECT_NE(event.find("\ndata: {\"a\":1}\n\n"), std::string::npos);
  EXPECT_NE(client.read_until(": still here\n\n").find("still here"), std::string::npos);
  client.close();
  EXPECT_TRUE(soon([&] { return recorder_.streams == 1; }));
  EXPECT_TRUE(soon([&] { return hub_.counts().subscribers == 0; }));
}

TEST_F(HttpServerTest, DropsSlowEventClientOnly) {
  start();
  RawClient slow(port(), 4096);
  slow.send(get_text("/events"));
  ASSERT_TRUE(soon([&] { return hub_.counts().subscribers == 1; }));
  RawClient quick(port());
  quick.send(get_text("/events"));
  ASSERT_TRUE(soon([&] { return hub_.counts().subscribers == 2; }));
  const std::string data = "\"" + std::string(1000, 'x') + "\"";
  std::atomic<bool> reading{true};
  std::thread reader([&] {
    quick.patience(50ms);
    while (reading) quick.read_until("\n\n");
  });
  EXPECT_TRUE(soon(
      [&] {
        hub_.publish("fill", data);
        return hub_.counts().dropped_clients == 1;
      },
      20s));
  EXPECT_TRUE(soon([&] { return recorder_.count(Refusal::slow_stream) == 1; }));
  EXPECT_TRUE(soon([&] { return recorder_.open == 1; }));
  EXPECT_EQ(hub_.counts().subscribers, 1U);
  reading = false;
  reader.join();
}

TEST_F(HttpServerTest, StopFinishesRunningRequests) {
  start();
  RawClient idle(port());
  idle.send(get_text("/echo/a"));
  ASSERT_EQ(idle.reply().status, 200U);
  RawClient events(port());
  events.send(get_text("/events"));
  ASSERT_TRUE(soon([&] { return hub_.counts().subscribers == 1; }));
  RawClient running(port());
  running.send(get_text("/blocked"));
  ASSERT_TRUE(soon([&] { return blocked_ == 1; }));

  auto stopped = std::async(std::launch::async, [&] { return server_->stop(5s); });
  EXPECT_TRUE(idle.closed_within(2s));
  EXPECT_TRUE(events.closed_within(2s));
  EXPECT_THROW(RawClient late(port()), std::runtime_error);
  EXPECT_EQ(stopped.wait_for(0s), std::future_status::timeout);
  release_.set_value();
  const RawReply reply = running.reply();
  EXPECT_EQ(reply.body, "\"released\"");
  EXPECT_EQ(reply.headers.at("connection"), "close");
  EXPECT_TRUE(stopped.get());
  release_ = {};
}

TEST_F(HttpServerTest, StopCancelsRequestsAtDeadline) {
  start();
  RawClient running(port());
  running.send(get_text("/blocked"));
  ASSERT_TRUE(soon([&] { return blocked_ == 1; }));
  auto stopped = std::async(std::launch::async, [&] { return server_->stop(200ms); });
  EXPECT_TRUE(running.closed_within(2s));
  release_.set_value();
  EXPECT_FALSE(stopped.get());
  release_ = {};
}

TEST_F(HttpServerTest, ReportsListenFailure) {
  start();
  const auto taken = HttpServer::start({.port = port()}, router_);
  ASSERT_FALSE(taken.has_value());
  EXPECT_EQ(taken.error().fault, Fault::unavailable);
  EXPECT_EQ(taken.error().field, "http.port");
  const auto nowhere = HttpServer::start({.address = "localhost"}, router_);
  ASSERT_FALSE(nowhere.has_value());
  EXPECT_EQ(nowhere.error().field, "http.address");
}

TEST_F(HttpServerTest, FeedsWatchdog) {
  start();
  std::this_thread::sleep_for(350ms);
  EXPECT_LT(server_->silence(), 300ms);
}

TEST_F(HttpServerTest, ConcurrentClientsGetOwnAnswers) {
  start();
  std::atomic<int> wrong{0};
  std::vector<std::thread> clients;
  for (int c = 0; c < 16; ++c) {
    clients.emplace_back([&, c] {
      RawClient client(port());
      for (int i = 0; i < 100; ++i) {
        const std::string name = std::to_string(c) + "-" + std::to_string(i);
        client.send(get_text((i % 2 == 0 ? "/work/" : "/echo/") + name));
        if (client.reply().body != "\"" + name + "\"") ++wrong;
      }
    });
  }
  for (auto& client : clients) client.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_TRUE(soon([&] { return recorder_.exchanges == 1600; }));
}

}  // namespace
}  // namespace joulecast::http
