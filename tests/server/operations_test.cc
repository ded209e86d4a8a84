#include "server/http/operations.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "server/api/services.h"
#include "server/http/event_hub.h"
#include "server/http/openapi.h"
#include "server/http/static_files.h"
#include "server/logging.h"
#include "server/metrics.h"
#include "tests/server/handled.h"

namespace joulecast::http {
namespace {

using nlohmann::json;

Response get(const Router& router, std::string_view target,
             std::vector<std::pair<std::string_view, std::string_view>> headers = {}) {
  Request request;
  request.target = target;
  request.headers = std::move(headers);
  request.id = "r";
  return http::handled(router, request);
}

std::string header(const Response& response, std::string_view name) {
  for (const auto& [key, value] : response.headers) {
    if (key == name) return value;
  }
  return {};
}

std::string text_of(const Response& response) {
  return response.shared_body ? *response.shared_body : response.body;
}

class OperationsTest : public ::testing::Test {
 protected:
  OperationsTest() {
    auto rows = operations_endpoints(
        metrics_, {{"store", [this] { return store_; }}, {"lcm", [] { return Result<void>{}; }}});
    rows.push_back(events_endpoint(hub_));
    auto all = with_openapi(std::move(rows), api::schemas(), embedded_examples());
    EXPECT_TRUE(all.has_value()) << (all ? "" : describe(all.error()));
    router_ = std::make_unique<Router>(std::move(*all));
  }
  Metrics metrics_;
  EventHub hub_;
  Result<void> store_;
  std::unique_ptr<Router> router_;
};

TEST_F(OperationsTest, AnswersHealthAndVersion) {
  EXPECT_EQ(json::parse(get(*router_, "/healthz").body).at("status"), "live");
  EXPECT_EQ(json::parse(get(*router_, "/version").body).at("name"), "joulecastd");
}

TEST_F(OperationsTest, ReadyRequiresEveryCheck) {
  const Response ready = get(*router_, "/readyz");
  EXPECT_EQ(ready.status, 200U);
  EXPECT_EQ(json::parse(ready.body).at("checks"), json({"store", "lcm"}));
  store_ = fail(Fault::unavailable, "store.path", "disk full");
  const Response not_ready = get(*router_, "/readyz");
  EXPECT_EQ(not_ready.status, 503U);
  EXPECT_NE(not_ready.body.find("store: store.path: disk full"), std::string::npos);
}

TEST_F(OperationsTest, ShowsMetrics) {
  metrics_.counter("joulecast_test_total", "test", {{"reason", "a"}}).Increment(5);
  metrics_.histogram("joulecast_wait_seconds", "test", {0.1, 1}).Observe(0.5);
  metrics_.counter("joulecast_drops_total", "test", {{"reason", "late"}});
  metrics_.counter("joulecast_drops_total", "test", {{"reason", "duplicate"}}).Increment();
  int refreshed = 0;
  metrics_.series([&] {
    return std::vector<Metrics::Series>{{"joulecast_refreshed", "test", ++refreshed},
                                        {"joulecast_test_seconds", "test", 1.5}};
  });
  const Response response = get(*router_, "/metrics");
  EXPECT_TRUE(response.content_type.starts_with("text/plain; version=0.0.4"));
  for (const char* line :
       {"joulecast_test_total{reason=\"a\"} 5", "joulecast_test_seconds 1.5",
        "joulecast_wait_seconds_bucket{le=\"0.1\"} 0", "joulecast_wait_seconds_bucket{le=\"1\"} 1",
        "joulecast_drops_total{reason=\"late\"} 0", "joulecast_drops_total{reason=\"duplicate\"} 1"}) {
    EXPECT_NE(response.body.find(line), std::string::npos) << line << "\n" << response.body;
  }
  EXPECT_EQ(refreshed, 1);
}

TEST_F(OperationsTest, CountsExchangesByOperation) {
  HttpMetrics http(metrics_);
  const std::string operation = "getX";
  http.exchanged(
      {.operation = operation, .status = 200, .duration_s = 2e-4, .request_bytes = 10, .response_bytes = 20});
  http.exchanged(
      {.operation = operation, .status = 404, .duration_s = 2e-4, .request_bytes = 10, .response_bytes = 20});
  http.exchanged({.operation = operation, .status = 200, .duration_s = 900, .stream = true});
  http.refused(Refusal::body_size);
  const std::string text = metrics_.text();
  EXPECT_NE(text.find("joulecast_http_requests_total{code=\"200\",operation=\"getX\"} 2"), std::string::npos)
      << text;
  EXPECT_NE(text.find("joulecast_http_requests_total{code=\"404\",operation=\"getX\"} 1"), std::string::npos);
  EXPECT_NE(text.find("joulecast_http_request_duration_seconds_count{operation=\"getX\"} 2"),
            std::string::npos);
  EXPECT_NE(text.find("joulecast_http_refused_total{reason=\"body_size\"} 1"), std::string::npos);
  EXPECT_NE(text.find("joulecast_http_refused_total{reason=\"slow_stream\"} 0"), std::string::npos);
}

TEST_F(OperationsTest, DescribesEveryRoute) {
  const json document = json::parse(text_of(get(*router_, "/openapi.json")));
  EXPECT_EQ(document.at("openapi"), "3.1.0");
  std::size_t operations = 0;
  for (const auto& [path, methods] : document.at("paths").items()) operations += methods.size();
  EXPECT_EQ(operations, router_->endpoints().size());
  for (const Endpoint& endpoint : router_->endpoints()) {
    const json& operation = document.at("paths").at(endpoint.path).at("get");
    EXPECT_EQ(operation.at("operationId"), endpoint.operation_id);
  }
  EXPECT_TRUE(document.at("components").at("schemas").contains("problem"));
}

TEST(OpenApi, IncludesReferencedSchemas) {
  const auto reference = [](const char* to) { return described::Schema{{"$ref", to}}; };
  const described::Schemas schemas_given{
      {"problem", {{"type", "object"}}},
      {"a", {{"properties", {{"l", reference("#/properties/b")}, {"b", reference("b.schema.json")}}}}},
      {"b", {{"items", {{"oneOf", described::Schema::array({reference("a.schema.json")})}}}}},
      {"openapi", described::Schema::object()},
      {"unused", described::Schema::object()}};
  Endpoint endpoint;
  endpoint.method = Method::post;
  endpoint.path = "/v1/{id}/x";
  endpoint.operation_id = "x";
  endpoint.role = Role::read;
  endpoint.tag = "planning";
  endpoint.request_schema = "a";
  endpoint.response_schema = "b";
  endpoint.error_statuses = {404};
  endpoint.parameters = {{.name = "n", .type = Parameter::Type::integer, .minimum = 1}};
  const auto text = openapi_document(std::vector<Endpoint>{endpoint}, schemas_given, {});
  ASSERT_TRUE(text.has_value()) << describe(text.error());
  const json document = json::parse(*text);
  const json& schemas = document.at("components").at("schemas");
  EXPECT_EQ(schemas.at("a").at("properties").at("l").at("$ref"), "#/components/schemas/a/properties/b");
  EXPECT_EQ(schemas.at("a").at("properties").at("b").at("$ref"), "#/components/schemas/b");
  EXPECT_EQ(schemas.at("b").at("items").at("oneOf").at(0).at("$ref"), "#/components/schemas/a");
  EXPECT_FALSE(schemas.contains("unused"));
  const json& operation = document.at("paths").at("/v1/{id}/x").at("post");
  EXPECT_EQ(operation.at("parameters").at(0).at("in"), "path");
  EXPECT_EQ(operation.at("parameters").at(1).at("schema").at("minimum"), 1);
  for (const char* status : {"200", "400", "404", "406", "413", "415", "422", "500", "503"}) {
    EXPECT_TRUE(operation.at("responses").contains(status)) << status;
  }
  endpoint.response_schema = "missing";
  EXPECT_FALSE(openapi_document(std::vector<Endpoint>{endpoint}, schemas_given, {}).has_value());
}

std::string gunzip(std::string_view packed) {
  z_stream stream{};
  EXPECT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
  std::string text(1 << 20, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(text.data());
  stream.avail_out = static_cast<uInt>(text.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  text.resize(stream.total_out);
  inflateEnd(&stream);
  return text;
}

TEST(Assets, AreServedWithStrictPolicy) {
  const std::string page = "<!doctype html>" + std::string(2000, 'a');
  const std::vector<EmbeddedFile> files{
      {"index.html", page}, {"app.3f9a1c2b77.js", "1"}, {"plain.css", "p{}"}};
  const Router router(asset_endpoints(files));
  const Response plain = get(router, "/");
  EXPECT_EQ(text_of(plain), page);
  EXPECT_EQ(plain.content_type, "text/html; charset=utf-8");
  EXPECT_EQ(header(plain, "Cache-Control"), "no-cache");
  EXPECT_NE(header(plain, "Content-Security-Policy").find("default-src 'none'"), std::string::npos);
  EXPECT_EQ(header(plain, "Content-Security-Policy").find("unsafe"), std::string::npos);

  const Response packed = get(router, "/index.html", {{"Accept-Encoding", "br, gzip;q=0.8"}});
  EXPECT_EQ(header(packed, "Content-Encoding"), "gzip");
  EXPECT_EQ(gunzip(text_of(packed)), page);
  EXPECT_NE(header(packed, "ETag"), header(plain, "ETag"));
  EXPECT_EQ(header(get(router, "/", {{"Accept-Encoding", "gzip;q=0"}}), "Content-Encoding"), "");

  const Response fresh = get(router, "/", {{"If-None-Match", header(plain, "ETag")}});
  EXPECT_EQ(fresh.status, 304U);
  EXPECT_EQ(text_of(fresh), "");
  EXPECT_EQ(get(router, "/", {{"If-None-Match", "\"other\", W/" + header(plain, "ETag")}}).status, 304U);
  EXPECT_EQ(get(router, "/", {{"If-None-Match", "\"other\""}}).status, 200U);

  EXPECT_EQ(header(get(router, "/app.3f9a1c2b77.js"), "Cache-Control"),
            "public, max-age=31536000, immutable");
  EXPECT_EQ(header(get(router, "/plain.css"), "Cache-Control"), "no-cache");
}

TEST(Assets, RejectPathsOutsideDirectory) {
  namespace fs = std::filesystem;
  const fs::path root = fs::temp_directory_path() / ("joulecast-assets-" + std::to_string(::getpid()));
  fs::create_directories(root / "web" / "sub");
  std::ofstream(root / "secret.txt") << "secret";
  std::ofstream(root / "web" / "index.html") << "page";
  std::ofstream(root / "web" / ".hidden") << "secret";
  std::ofstream(root / "web" / "sub" / "deep.txt") << "secret";
  fs::create_symlink(root / "secret.txt", root / "web" / "link.txt");
  auto rows = asset_endpoints_from((root / "web").string());
  ASSERT_TRUE(rows.has_value());
  const Router router(std::move(*rows));
  EXPECT_EQ(text_of(get(router, "/index.html")), "page");
  for (const char* target :
       {"/../secret.txt", "/%2e%2e/secret.txt", "/..%2Fsecret.txt", "/link.txt", "/.hidden",
        "/sub/../../secret.txt", "//secret.txt", "/sub/deep.txt", "/%2e%2e%5Csecret.txt"}) {
    EXPECT_EQ(get(router, target).status, 404U) << target;
  }
  fs::remove_all(root);
  EXPECT_FALSE(asset_endpoints_from(root.string()).has_value());
}

TEST(Logging, WritesJsonLines) {
  const std::string line = format_log_line(LogFormat::json, LogLevel::warning, "a \"b\"\n\x01",
                                           {{"robot_id", "x\\y\r\n"}}, 1'700'000'000'123'456);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const json parsed = json::parse(line);
  EXPECT_EQ(parsed.at("time"), "2023-11-14T22:13:20.123456Z");
  EXPECT_EQ(parsed.at("level"), "warning");
  EXPECT_EQ(parsed.at("message"), "a \"b\"\n\x01");
  EXPECT_EQ(parsed.at("robot_id"), "x\\y\r\n");
  EXPECT_EQ(format_log_line(LogFormat::text, LogLevel::info, "started", {{"port", "80\n81"}},
                            1'700'000'000'123'456),
            "22:13:20.123 info    started  port=80\\u000a81");
}

TEST(MetricsDeathTest, NamesFollowTheConvention) {
  Metrics metrics;
  EXPECT_DEATH(metrics.counter("joulecast_things", ""), "convention");
  EXPECT_DEATH(metrics.histogram("joulecast_things_total", "", {}), "convention");
  EXPECT_DEATH(metrics.histogram("things_seconds", "", {}), "convention");
}

}  // namespace
}  // namespace joulecast::http
