#include "server/http/router.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "server/http/problem.h"
#include "server/http/text.h"
#include "tests/server/handled.h"

namespace joulecast::http {
namespace {

using nlohmann::json;

Endpoint row(Method method, std::string path, Handler handler) {
  Endpoint endpoint;
  endpoint.method = method;
  endpoint.path = path;
  endpoint.operation_id = std::string(to_string(method)) + path;
  endpoint.handler = std::move(handler);
  return endpoint;
}

Handler says(std::string text) {
  return [text](const Request&) -> Result<Response> { return json_response(text); };
}

std::vector<Endpoint> table() {
  std::vector<Endpoint> rows;
  rows.push_back(row(Method::get, "/", says("root")));
  rows.push_back(row(Method::get, "/v1/robots", says("robots")));
  rows.push_back(row(Method::get, "/v1/robots/{id}", [](const Request& request) -> Result<Response> {
    return json_response("robot " + request.param("id"));
  }));
  rows.push_back(row(Method::put, "/v1/robots/{robot_id}", [](const Request& request) -> Result<Response> {
    return json_response("put " + request.param("robot_id") + " " + request.json->dump());
  }));
  rows.back().request_schema = "robot";
  rows.push_back(row(Method::get, "/v1/robots/{id}/state", says("state")));
  rows.push_back(row(Method::get, "/v1/robots/newest", says("newest")));
  rows.push_back(row(Method::get, "/v1/missions", [](const Request& request) -> Result<Response> {
    return json_response(std::to_string(request.query_integer("limit").value_or(-1)) + " " +
                         std::string(request.query_value("robot_id").value_or("all")));
  }));
  rows.back().parameters = {
      {.name = "limit", .type = Parameter::Type::integer, .minimum = 1, .maximum = 1000},
      {.name = "robot_id"},
      {.name = "order", .choices = {"newest", "oldest"}},
      {.name = "live", .type = Parameter::Type::boolean},
      {.name = "width_s", .type = Parameter::Type::number, .minimum = 0.1}};
  rows.push_back(row(Method::get, "/v1/table", [](const Request& request) -> Result<Response> {
    const auto first = std::stoi(std::string(request.query_value("cursor").value_or("0")));
    Response page;
    page.body =
        "n\n" + std::to_string(first) + " of " + std::to_string(*request.query_integer("limit")) + "\n";
    if (first < 2) page.next_cursor = std::to_string(first + 1);
    return page;
  }));
  rows.back().csv = true;
  rows.back().parameters = {
      {.name = "limit", .type = Parameter::Type::integer, .minimum = 1, .maximum = 9, .usual = 3},
      {.name = "cursor"}};
  rows.push_back(row(Method::get, "/v1/needs", says("has")));
  rows.back().parameters = {{.name = "from", .required = true}};
  return rows;
}

class RouterTest : public ::testing::Test {
 protected:
  Response ask(Method method, std::string_view target,
               std::vector<std::pair<std::string_view, std::string_view>> headers = {},
               std::string body = {}) {
    Request request;
    request.method = method;
    request.target = target;
    request.headers = std::move(headers);
    request.body = std::move(body);
    request.id = "r1";
    return http::handled(router_, request);
  }
  Router router_{table()};
};

std::string header(const Response& response, std::string_view name) {
  for (const auto& [key, value] : response.headers) {
    if (key == name) return value;
  }
  return {};
}

TEST_F(RouterTest, FindsEndpoints) {
  EXPECT_EQ(ask(Method::get, "/").body, "root");
  EXPECT_EQ(ask(Method::get, "/v1/robots").body, "robots");
  EXPECT_EQ(ask(Method::get, "/v1/robots/amr-07").body, "robot amr-07");
  EXPECT_EQ(ask(Method::head, "/v1/robots/amr-07").body, "robot amr-07");
  EXPECT_EQ(ask(Method::get, "/v1/robots/amr-07/state").body, "state");
  EXPECT_EQ(ask(Method::get, "/v1/robots/newest").body, "newest");
  // The literal branch has no "state": the search must return to the template.
  EXPECT_EQ(ask(Method::get, "/v1/robots/newest/state").body, "state");
}

TEST_F(RouterTest, DecodesSegmentsSeparately) {
  EXPECT_EQ(ask(Method::get, "/v1/robots/a%2Fb").body, "robot a/b");
  EXPECT_EQ(ask(Method::get, "/v1/robots/a+b").body, "robot a+b");
  EXPECT_EQ(ask(Method::get, "/v1/robots/%C3%BC").body, "robot ü");
  EXPECT_EQ(ask(Method::get, "http://host:80/v1/robots/x").body, "robot x");
  for (const char* bad :
       {"/v1/robots/%", "/v1/robots/%4", "/v1/robots/%GG", "/v1/robots/%00", "/v1/robots/%0a",
        "/v1/robots/%FF", "/v1/robots/%C0%AF", "/v1/robots/%ED%A0%80", "/v1/robots/x#y", "v1"}) {
    EXPECT_EQ(ask(Method::get, bad).status, 400U) << bad;
  }
}

TEST_F(RouterTest, DistinguishesUnknownPathsAndMethods) {
  EXPECT_EQ(ask(Method::get, "/v1/nothing").status, 404U);
  EXPECT_EQ(ask(Method::get, "/v1/robots/").status, 404U);
  EXPECT_EQ(ask(Method::get, "/v1/robots/../x").status, 404U);
  EXPECT_EQ(ask(Method::get, "/v1").status, 404U);
  const Response wrong = ask(Method::del, "/v1/robots/x");
  EXPECT_EQ(wrong.status, 405U);
  EXPECT_EQ(header(wrong, "Allow"), "GET, HEAD, PUT, OPTIONS");
  EXPECT_EQ(ask(Method::other, "/v1/robots").status, 405U);
  const Response options = ask(Method::options, "/v1/robots");
  EXPECT_EQ(options.status, 204U);
  EXPECT_EQ(header(options, "Allow"), "GET, HEAD, OPTIONS");
}

TEST_F(RouterTest, ChecksQueryKeysAndValues) {
  EXPECT_EQ(ask(Method::get, "/v1/missions?limit=20&robot_id=amr%2007").body, "20 amr 07");
  EXPECT_EQ(ask(Method::get, "/v1/missions?robot_id=a+b").body, "-1 a b");
  const auto fault = [&](std::string_view target, unsigned status, std::string_view field) {
    const Response response = ask(Method::get, target);
    EXPECT_EQ(response.status, status) << target;
    EXPECT_EQ(json::parse(response.body).at("field"), field) << target;
  };
  fault("/v1/missions?limmit=20", 400, "limmit");
  fault("/v1/robots?x", 400, "x");
  fault("/v1/missions?limit=20&limit=30", 400, "limit");
  fault("/v1/missions?limit=%zz", 400, "limit");
  fault("/v1/missions?limit=0", 422, "limit");
  fault("/v1/missions?limit=1001", 422, "limit");
  fault("/v1/missions?limit=2.5", 422, "limit");
  fault("/v1/missions?limit=", 422, "limit");
  fault("/v1/missions?width_s=nan", 422, "width_s");
  fault("/v1/missions?width_s=1e999", 422, "width_s");
  fault("/v1/missions?live=yes", 422, "live");
  fault("/v1/missions?order=random", 422, "order");
  fault("/v1/needs", 422, "from");
}

TEST_F(RouterTest, LinksNextPage) {
  const Response page = ask(Method::get, "/v1/table?limit=4", {{"Accept", "text/csv"}});
  EXPECT_EQ(page.body, "n\n0 of 4\n");
  EXPECT_EQ(header(page, "Link"), "</v1/table?limit=4&cursor=1>; rel=\"next\"");
  EXPECT_EQ(header(ask(Method::get, "/v1/table?limit=4&cursor=2", {{"Accept", "text/csv"}}), "Link"), "");
  EXPECT_EQ(ask(Method::get, "/v1/table").body, "n\n0 of 3\n");
}

TEST_F(RouterTest, ChecksTypesOfBodiesAndAnswers) {
  const std::vector<std::pair<std::string_view, std::string_view>> as_json{
      {"Content-Type", "application/json; charset=utf-8"}};
  EXPECT_EQ(ask(Method::put, "/v1/robots/x", as_json, R"({"a": 1})").body, R"(put x {"a":1})");
  EXPECT_EQ(ask(Method::put, "/v1/robots/x", {{"content-type", "application/merge-patch+json"}}, "{}").status,
            200U);
  EXPECT_EQ(ask(Method::put, "/v1/robots/x", {}, "{}").status, 415U);
  EXPECT_EQ(ask(Method::put, "/v1/robots/x", {{"Content-Type", "text/plain"}}, "{}").status, 415U);
  auto packed = as_json;
  packed.emplace_back("Content-Encoding", "gzip");
  EXPECT_EQ(ask(Method::put, "/v1/robots/x", packed, "{}").status, 415U);

  for (const char* accept : {"*/*", "application/json", "application/*;q=0.5", "text/html, */*;q=0.1", ""}) {
    EXPECT_EQ(ask(Method::get, "/v1/robots", {{"Accept", accept}}).status, 200U) << accept;
  }
  for (const char* accept : {"text/html", "application/json;q=0", "*/*, application/json;q=0.0", "image/*"}) {
    EXPECT_EQ(ask(Method::get, "/v1/robots", {{"Accept", accept}}).status, 406U) << accept;
  }
}

TEST_F(RouterTest, ReportsJsonErrors) {
  const std::vector<std::pair<std::string_view, std::string_view>> as_json{
      {"Content-Type", "application/json"}};
  for (const char* body : {"", "{", "{}x", "[1,]", "NaN", "{\"a\":1e999}", "\"\xff\"", "{\"a\":1,\"a\":2}"}) {
    const Response response = ask(Method::put, "/v1/robots/x", as_json, body);
    EXPECT_EQ(response.status, 400U) << body;
    EXPECT_EQ(response.content_type, "application/problem+json");
    EXPECT_EQ(json::parse(response.body).at("type"), "urn:joulecast:problem:malformed-json") << body;
  }
  const Response repeated = ask(Method::put, "/v1/robots/x", as_json, R"({"motor": {"a": 1, "a": 2}})");
  EXPECT_EQ(json::parse(repeated.body).at("field"), "/motor/a");
}

TEST(JsonText, PointersUseArrayIndices) {
  const auto field = [](std::string_view text) { return parse_json(text).error().field; };
  EXPECT_EQ(field(R"({"path": [{"length_m": 1, "length_m": 2}]})"), "/path/0/length_m");
  EXPECT_EQ(field(R"({"path": [1, [2, {}, {"a": 1, "a": 2}]]})"), "/path/1/2/a");
  EXPECT_EQ(field(R"([{"a": 1, "a": 2}])"), "/0/a");
  EXPECT_EQ(field(R"({"a/b": {"~": 1, "~": 2}})"), "/a~1b/~0");
  EXPECT_EQ(parse_json(R"({"a": [1, [2, []]]})", 3).error().field, "/a/1/1");
  for (const char* text :
       {R"({"a": [1, NaN]})", R"({"a": [1, -Infinity]})", R"({"a": [1, nan]})", R"({"a": [1, inf]})"}) {
    const Error error = parse_json(text).error();
    EXPECT_EQ(error.field, "/a/1") << text;
    EXPECT_NE(error.message.find("; JSON has no "), std::string::npos) << error.message;
    EXPECT_NE(error.message.find("write null"), std::string::npos) << error.message;
  }
  for (const char* text : {R"({"a": none})", R"({"a": i})", R"({"a": -})", "[n", "N"})
    EXPECT_EQ(parse_json(text).error().message.find("JSON has no"), std::string::npos) << text;
  EXPECT_EQ(parse_json(R"([[], [[]]])", 2).error().field, "/1/0");
  const Error beyond = parse_json(R"({"a": [1, {"b": 1e999}]})").error();
  EXPECT_EQ(beyond.field, "/a/1/b");
  EXPECT_TRUE(beyond.message.ends_with("'1e999'; must be finite")) << beyond.message;
}

TEST(JsonText, BoundsDepthAndKeepsValues) {
  EXPECT_TRUE(parse_json(std::string(64, '[') + std::string(64, ']')).has_value());
  EXPECT_FALSE(parse_json(std::string(65, '[') + std::string(65, ']')).has_value());
  EXPECT_FALSE(parse_json(std::string(1'000'000, '[')).has_value());
  const std::string text =
      R"({"a":[1,-2,2.5,true,null,"x",{"b":[]}],"c":{"d":{"e":"f"}},"g":18446744073709551615})";
  EXPECT_EQ(parse_json(text).value(), json::parse(text));
}

// Libraries report faults by their own field names; the client gets the names of its request.
TEST(Router, ErrorsNameClientFields) {
  std::vector<Endpoint> rows;
  const auto fails = [](Fault fault, std::string field) {
    return [fault, field](const Request&) -> Result<Response> { return fail(fault, field, "is wrong"); };
  };
  const auto add = [&](Method method, std::string path, Fault fault, std::string field, bool body) {
    rows.push_back(row(method, std::move(path), fails(fault, std::move(field))));
    if (body) rows.back().request_schema = "some";
    rows.back().parameters = {{.name = "cursor"}};
  };
  add(Method::get, "/missions/{id}", Fault::not_found, "mission", false);
  add(Method::get, "/missions", Fault::invalid, "cursor", false);
  add(Method::post, "/robots/{id}/profile", Fault::infeasible, "deadline_s", true);
  add(Method::post, "/robots/{id}/state", Fault::not_found, "id", true);
  add(Method::post, "/queue", Fault::unavailable, "store", true);
  const Router router(std::move(rows));
  const auto told = [&](Method method, std::string target) {
    Request request;
    request.method = method;
    request.target = std::move(target);
    request.headers = {{"Content-Type", "application/json"}};
    request.body = "{}";
    return json::parse(http::handled(router, request).body);
  };
  EXPECT_EQ(told(Method::get, "/missions/9").at("field"), "id");
  EXPECT_EQ(told(Method::get, "/missions/9").at("constraint"), "is wrong");
  EXPECT_EQ(told(Method::get, "/missions").at("field"), "cursor");
  EXPECT_EQ(told(Method::post, "/robots/x/profile").at("field"), "/deadline_s");
  EXPECT_EQ(told(Method::post, "/robots/x/state").at("field"), "id");
  EXPECT_EQ(told(Method::post, "/queue").at("field"), "store");
  EXPECT_EQ(told(Method::get, "/nowhere").at("field"), "path");
  EXPECT_TRUE(told(Method::get, "/nowhere").contains("constraint"));
}

TEST(Problem, MapsFaultsToStatuses) {
  EXPECT_EQ(problem(Error{Fault::invalid, "/mass/chassis_kg", "must be positive, is -1"}, "r").status, 422U);
  EXPECT_EQ(problem(Error{Fault::not_found, "", "no robot x"}, "r").status, 404U);
  EXPECT_EQ(problem(Error{Fault::conflict, "", "x"}, "r").status, 409U);
  EXPECT_EQ(problem(Error{Fault::infeasible, "", "x"}, "r").status, 422U);
  EXPECT_EQ(problem(Error{Fault::too_large, "", "x"}, "r").status, 413U);
  EXPECT_EQ(problem(Error{Fault::corrupt, "", "x"}, "r").status, 500U);
  EXPECT_EQ(problem(Error{Fault::internal, "", "x"}, "r").status, 500U);
  const Response busy = problem(Error{Fault::unavailable, "", "disk full"}, "r");
  EXPECT_EQ(busy.status, 503U);
  EXPECT_EQ(header(busy, "Retry-After"), "1");
}

TEST(Problem, NamesFieldConstraintAndRequest) {
  const Response response =
      problem(Error{Fault::invalid, "/mass/chassis_kg", "must be positive, is -1"}, "r7");
  const json document = json::parse(response.body);
  EXPECT_EQ(document.at("type"), "urn:joulecast:problem:invalid");
  EXPECT_EQ(document.at("title"), "Unprocessable Content");
  EXPECT_EQ(document.at("status"), 422);
  EXPECT_EQ(document.at("detail"), "/mass/chassis_kg: must be positive, is -1");
  EXPECT_EQ(document.at("field"), "/mass/chassis_kg");
  EXPECT_EQ(document.at("constraint"), "must be positive, is -1");
  EXPECT_EQ(document.at("request_id"), "r7");
  EXPECT_EQ(document.at("instance"), "urn:joulecast:request:r7");
}

TEST(Problem, ReplacesInvalidUtf8) {
  const Response response = problem(Error{Fault::invalid, "\xff", "is \xfe"}, "r");
  EXPECT_TRUE(json::accept(response.body));
}

TEST(RouterDeathTest, RejectsAmbiguousTables) {
  const auto build = [](std::vector<Endpoint> rows) { Router router(std::move(rows)); };
  EXPECT_DEATH(build({row(Method::get, "/a/{x}", says("")), row(Method::get, "/a/{y}", says(""))}), "taken");
  EXPECT_DEATH(build({row(Method::get, "/a/x{y}", says(""))}), "whole");
  EXPECT_DEATH(build({row(Method::get, "/a", {})}), "no handler");
}

}  // namespace
}  // namespace joulecast::http
