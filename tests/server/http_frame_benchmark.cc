// Request rate and latency of the HTTP frame against a bare Beast server that answers a body of the same
// size, in turns within one run, so that only the ratio counts. Usage: http_frame_benchmark [seconds a round]
// [rounds]
#include "server/http/asio.h"
// asio.h stays first.
#include <algorithm>
#include <atomic>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "raw_client.h"
#include "server/http/http_server.h"

namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
using Clock = std::chrono::steady_clock;
const std::string body(600, 'x');

// What Beast does when asked for nothing else: parse, answer, repeat.
class BareSession : public std::enable_shared_from_this<BareSession> {
 public:
  explicit BareSession(net::ip::tcp::socket socket) : stream_(std::move(socket)) {}
  void read() {
    request_ = {};
    beast::http::async_read(stream_, buffer_, request_, [self = shared_from_this()](auto error, std::size_t) {
      if (!error) self->write();
    });
  }

 private:
  void write() {
    response_ = {beast::http::status::ok, request_.version()};
    response_.set(beast::http::field::content_type, "application/json");
    response_.body() = body;
    response_.keep_alive(request_.keep_alive());
    response_.prepare_payload();
    beast::http::async_write(stream_, response_, [self = shared_from_this()](auto error, std::size_t) {
      if (!error) self->read();
    });
  }
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  beast::http::request<beast::http::string_body> request_;
  beast::http::response<beast::http::string_body> response_;
};

class BareServer {
 public:
  BareServer() : acceptor_(io_, {net::ip::make_address("127.0.0.1"), 0}) {
    accept();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~BareServer() {
    io_.stop();
    thread_.join();
  }
  std::uint16_t port() { return acceptor_.local_endpoint().port(); }

 private:
  void accept() {
    acceptor_.async_accept([this](auto error, net::ip::tcp::socket socket) {
      if (error) return;
      socket.set_option(net::ip::tcp::no_delay(true));
      std::make_shared<BareSession>(std::move(socket))->read();
      accept();
    });
  }
  net::io_context io_{1};
  net::ip::tcp::acceptor acceptor_;
  std::thread thread_;
};

struct Figures {
  double rate = 0;  // requests a second
  double p99_ms = 0;
};

Figures load(std::uint16_t port, const std::string& path, double seconds) {
  constexpr int clients = 8;
  const auto end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  std::vector<std::vector<float>> latencies(clients);
  std::vector<std::thread> threads;
  for (int c = 0; c < clients; ++c) {
    threads.emplace_back([&, c] {
      joulecast::test::RawClient client(port);
      const std::string text = joulecast::test::get_text(path, "Accept: */*\r\nUser-Agent: benchmark\r\n");
      auto& mine = latencies[static_cast<std::size_t>(c)];
      for (auto begin = Clock::now(); begin < end;) {
        client.send(text);
        const std::string head = client.read_until("\r\n\r\n");
        if (head.empty() || client.read_until(body).size() != body.size()) std::abort();
        const auto now = Clock::now();
        mine.push_back(std::chrono::duration<float, std::milli>(now - begin).count());
        begin = now;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  std::vector<float> all;
  for (const auto& each : latencies) all.insert(all.end(), each.begin(), each.end());
  const auto at = all.begin() + static_cast<std::ptrdiff_t>(all.size() * 99 / 100);
  std::nth_element(all.begin(), at, all.end());
  return {static_cast<double>(all.size()) / seconds, *at};
}

}  // namespace

int main(int argc, char** argv) {
  using namespace joulecast::http;
  const double seconds = argc > 1 ? std::atof(argv[1]) : 2;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 3;
  std::vector<Endpoint> rows;
  for (const auto& [path, where] :
       {std::pair{"/v1/io/{id}", Run::io}, std::pair{"/v1/worker/{id}", Run::worker}}) {
    Endpoint row;
    row.path = path;
    row.operation_id = path;
    row.run = where;
    row.handler = [](const Request&) -> joulecast::Result<Response> { return json_response(body); };
    rows.push_back(std::move(row));
  }
  const Router router(std::move(rows));
  auto server = HttpServer::start({}, router);
  if (!server) return 1;
  BareServer bare;
  std::vector<double> io_ratio;
  std::vector<double> worker_ratio;
  for (int round = 0; round < rounds; ++round) {
    const Figures reference = load(bare.port(), "/", seconds);
    const Figures io = load((*server)->port(), "/v1/io/7", seconds);
    const Figures worker = load((*server)->port(), "/v1/worker/7", seconds);
    std::printf("bare %.0f/s p99 %.2f ms | io %.0f/s p99 %.2f ms | worker %.0f/s p99 %.2f ms\n",
                reference.rate, reference.p99_ms, io.rate, io.p99_ms, worker.rate, worker.p99_ms);
    io_ratio.push_back(io.rate / reference.rate);
    worker_ratio.push_back(worker.rate / reference.rate);
  }
  std::sort(io_ratio.begin(), io_ratio.end());
  std::sort(worker_ratio.begin(), worker_ratio.end());
  std::printf("median ratio to bare Beast: io %.2f, worker %.2f\n", io_ratio[io_ratio.size() / 2],
              worker_ratio[worker_ratio.size() / 2]);
  return 0;
}
