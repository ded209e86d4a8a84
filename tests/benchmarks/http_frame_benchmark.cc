// Request rate and latency of the HTTP server compared with a bare Beast server that returns a body of the
// same size. Both run alternately in one run; only the ratio is meaningful.
// Usage: http_frame_benchmark [SECONDS_PER_ROUND] [ROUNDS]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "server/http/http_server.h"
#include "tests/benchmarks/bare_server.h"
#include "tests/benchmarks/http_load.h"

int main(int argc, char** argv) {
  using namespace joulecast::http;
  using namespace joulecast::benchmarks;
  const double seconds = argc > 1 ? std::atof(argv[1]) : 2;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 3;
  const std::string body(600, 'x');
  std::vector<Endpoint> rows;
  for (const auto& [path, where] :
       {std::pair{"/v1/io/{id}", Run::io}, std::pair{"/v1/worker/{id}", Run::worker}}) {
    Endpoint row;
    row.path = path;
    row.operation_id = path;
    row.run = where;
    row.handler = [&body](const Request&) -> joulecast::Result<Response> { return json_response(body); };
    rows.push_back(std::move(row));
  }
  const Router router(std::move(rows));
  auto server = HttpServer::start({}, router);
  if (!server) return 1;
  const BareServer bare(body);
  std::vector<double> io_ratio;
  std::vector<double> worker_ratio;
  for (int round = 0; round < rounds; ++round) {
    const LoadFigures reference = load_http(bare.port(), http_request_text("/"), seconds);
    const LoadFigures io = load_http((*server)->port(), http_request_text("/v1/io/7"), seconds);
    const LoadFigures worker = load_http((*server)->port(), http_request_text("/v1/worker/7"), seconds);
    std::printf("bare %.0f/s p99 %.2f ms | io %.0f/s p99 %.2f ms | worker %.0f/s p99 %.2f ms\n",
                reference.rate_1_s, reference.p99_ms, io.rate_1_s, io.p99_ms, worker.rate_1_s, worker.p99_ms);
    io_ratio.push_back(io.rate_1_s / reference.rate_1_s);
    worker_ratio.push_back(worker.rate_1_s / reference.rate_1_s);
  }
  std::sort(io_ratio.begin(), io_ratio.end());
  std::sort(worker_ratio.begin(), worker_ratio.end());
  std::printf("median ratio to bare Beast: io %.2f, worker %.2f\n", io_ratio[io_ratio.size() / 2],
              worker_ratio[worker_ratio.size() / 2]);
  return 0;
}
