// Access rights, checked for every endpoint of the daemon.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "access/sha256.h"
#include "access/token.h"
#include "server/api/services.h"
#include "server/embedded.h"
#include "server/http/admission.h"
#include "server/http/event_hub.h"
#include "server/http/gate.h"
#include "server/http/http_server.h"
#include "server/http/openapi.h"
#include "server/http/operations.h"
#include "server/http/static_files.h"
#include "server/metrics.h"
#include "tests/server/handled.h"

namespace joulecast::http {
namespace {

using nlohmann::json;

const std::map<Role, std::string> secrets{
    {Role::read, "s-read"}, {Role::plan, "s-plan"}, {Role::operate, "s-operate"}, {Role::admin, "s-admin"}};

// "/v1/robots/{id}" -> "/v1/robots/7"
std::string target_of(std::string path) {
  for (auto brace = path.find('{'); brace != std::string::npos; brace = path.find('{'))
    path.replace(brace, path.find('}') - brace + 1, "7");
  return path;
}

std::string header(const Response& response, std::string_view name) {
  for (const auto& [key, value] : response.headers)
    if (key == name) return value;
  return {};
}

// Every endpoint of the daemon. Handlers that need a fleet are replaced by ones that return 200.
std::vector<Endpoint> whole_table(Metrics& metrics, EventHub& events) {
  std::vector<Endpoint> table = api::endpoints(nullptr);
  table.push_back(events_endpoint(events));
  for (Endpoint& row : operations_endpoints(metrics, {})) table.push_back(std::move(row));
  table = *with_openapi(std::move(table), api::schemas(), embedded_examples());
  for (Endpoint& row : asset_endpoints(embedded_web())) table.push_back(std::move(row));
  for (Endpoint& row : table) {
    row.brief = nullptr;
    row.handler = [](const Request&) -> Result<Response> { return json_response("1"); };
  }
  return table;
}

class AccessTest : public ::testing::Test {
 protected:
  AccessTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "joulecast-gate-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    for (const auto& [role, secret] : secrets) add(std::string(access::name(role)), role, secret);
    open();
  }
  ~AccessTest() override { std::filesystem::remove_all(folder_); }

  std::string file() const { return (folder_ / "tokens.json").string(); }

  void add(const std::string& name, Role role, const std::string& secret, const std::string& robots = "",
           std::int64_t expires_utime_us = 0) {
    const auto added = access::change_tokens(file(), [&](std::vector<access::Token>& tokens) -> Result<void> {
      tokens.push_back({.name = name,
                        .role = role,
                        .robots = robots,
                        .created_utime_us = 1,
                        .expires_utime_us = expires_utime_us,
                        .sha256 = access::sha256_hex(secret)});
      return {};
    });
    ASSERT_TRUE(added) << describe(added.error());
  }
  void revoke(const std::string& name) {
    ASSERT_TRUE(access::change_tokens(file(), [&](std::vector<access::Token>& tokens) -> Result<void> {
      std::erase_if(tokens, [&](const access::Token& token) { return token.name == name; });
      return {};
    }));
  }

  void open() {
    gate_ = *Gate::open({.token_file = file(),
                         .now_utime_us = [this] { return now_us_; },
                         .audit = [this](AccessEvent event) -> Result<void> {
                           if (!audit_open_) return fail(Fault::unavailable, "", "stopping");
                           events_.push_back(std::move(event));
                           return {};
                         },
                         .not_audited =
                             [this](const AccessEvent& event, const Error& error) {
                               lost_.push_back(event.action + ": " + error.message);
                             }});
    std::vector<Endpoint> table;
    for (Endpoint& row : whole_table(metrics_, hub_)) table.push_back(gate_->audited(std::move(row)));
    for (Endpoint& row : gate_->session_endpoints()) table.push_back(std::move(row));
    router_ = std::make_unique<Router>(
        std::move(table), Router::FaultSink{},
        [this](const Endpoint& endpoint, Request& request) { return gate_->refuse(endpoint, request); });
  }

  Response ask(Method method, std::string target, std::string authorization = "", std::string cookie = "",
               std::string body = "") {
    Request request;
    request.method = method;
    request.target = target;
    request.id = "r-1";
    request.address = address_;
    request.secure = secure_;
    request.body = std::move(body);
    if (!authorization.empty()) request.headers.emplace_back("Authorization", authorization);
    if (!cookie.empty()) request.headers.emplace_back("Cookie", cookie);
    if (!request.body.empty()) request.headers.emplace_back("Content-Type", "application/json");
    return http::handled(*router_, request);
  }
  Response ask_with(const std::string& secret, Method method, const std::string& target) {
    return ask(method, target, "Bearer " + secret);
  }

  std::filesystem::path folder_;
  std::int64_t now_us_ = 1'790'000'000'000'000;
  bool audit_open_ = true, secure_ = false;
  std::string address_ = "192.0.2.7";
  std::vector<std::string> lost_;
  std::vector<AccessEvent> events_;
  Metrics metrics_;
  EventHub hub_;
  std::unique_ptr<Gate> gate_;
  std::unique_ptr<Router> router_;
};

TEST_F(AccessTest, EveryEndpointHasRole) {
  for (const Endpoint& row : router_->endpoints()) EXPECT_NE(row.role, Role::unstated) << row.operation_id;
}

TEST_F(AccessTest, OpenEndpointsAreListed) {
  for (const Endpoint& row : router_->endpoints()) {
    if (row.role != Role::open) continue;
    EXPECT_TRUE(row.path == "/healthz" || row.path == "/readyz" || row.path == "/v1/session" ||
                row.operation_id == "getAsset" || row.operation_id == "getOperatorPage")
        << row.path;
  }
}

TEST_F(AccessTest, WritesRequirePlanRole) {
  for (const Endpoint& row : router_->endpoints()) {
    if (row.method == Method::get || row.path == "/v1/session") continue;
    EXPECT_GE(row.role, Role::plan) << row.path;
  }
}

TEST_F(AccessTest, EndpointsRejectInsufficientRoles) {
  std::size_t refused = 0;
  for (const Endpoint& row : router_->endpoints()) {
    if (row.role == Role::open) continue;
    const std::string target = target_of(row.path);
    for (const char* authorization : {"", "Bearer wrong", "Bearer ", "Basic cm9vdA==", "s-admin"}) {
      const Response answer = ask(row.method, target, authorization);
      EXPECT_EQ(answer.status, 401U) << row.operation_id << " " << authorization;
      EXPECT_TRUE(header(answer, "WWW-Authenticate").starts_with("Bearer realm=\"joulecast\""));
      EXPECT_EQ(json::parse(answer.body).at("type"), "urn:joulecast:problem:unauthorized");
    }
    for (const auto& [role, secret] : secrets) {
      const Response answer = ask_with(secret, row.method, target);
      if (role >= row.role) {
        EXPECT_NE(answer.status, 401U) << row.operation_id;
        EXPECT_NE(answer.status, 403U) << row.operation_id;
        continue;
      }
      ++refused;
      EXPECT_EQ(answer.status, 403U) << row.operation_id << " " << secret;
      const json problem = json::parse(answer.body);
      EXPECT_EQ(problem.at("type"), "urn:joulecast:problem:forbidden");
      EXPECT_NE(problem.at("detail").get<std::string>().find("role " + std::string(access::name(row.role))),
                std::string::npos)
          << problem;
    }
  }
  EXPECT_GE(refused, 10U);
}

TEST_F(AccessTest, EndpointWithoutRoleIsRejected) {
  Endpoint forgotten{.path = "/forgotten", .operation_id = "forgotten"};
  EXPECT_FALSE(openapi_document(std::vector{forgotten}, api::schemas(), embedded_examples()));
  Request request;
  request.headers.emplace_back("Authorization", "Bearer s-admin");
  EXPECT_EQ(gate_->refuse(forgotten, request)->status, 403U);
}

TEST_F(AccessTest, DocumentStatesRoles) {
  const json document =
      json::parse(*openapi_document(api::endpoints(nullptr), api::schemas(), embedded_examples()));
  for (const Endpoint& row : api::endpoints(nullptr)) {
    std::string method(to_string(row.method));
    for (char& c : method) c = static_cast<char>(c - 'A' + 'a');
    const json roles = json::array({access::name(row.role)});
    EXPECT_EQ(document.at("paths").at(row.path).at(method).at("security"),
              json::array({{{"bearer", roles}}, {{"session", roles}}}));
  }
}

TEST_F(AccessTest, RejectsExpiredTokens) {
  add("late", Role::admin, "s-late", "", now_us_ + 5);
  EXPECT_EQ(ask_with("s-late", Method::get, "/v1/robots").status, 200U);
  now_us_ += 5;
  EXPECT_EQ(ask_with("s-late", Method::get, "/v1/robots").status, 401U);
}

TEST_F(AccessTest, TokenChangesApplyImmediately) {
  EXPECT_EQ(ask_with("s-read", Method::get, "/v1/robots").status, 200U);
  revoke("read");
  EXPECT_EQ(ask_with("s-read", Method::get, "/v1/robots").status, 401U);
  add("second", Role::read, "s-second");
  EXPECT_EQ(ask_with("s-second", Method::get, "/v1/robots").status, 200U);
  std::vector<std::string> told;
  for (const AccessEvent& event : events_)
    if (event.action.starts_with("token_"))
      told.push_back(event.action + " " + json::parse(event.detail_json).at("name").get<std::string>());
  EXPECT_EQ(told.back(), "token_in_force second");
  EXPECT_NE(std::find(told.begin(), told.end(), "token_removed read"), told.end());
}

TEST_F(AccessTest, UnreadableFileKeepsTokens) {
  EXPECT_TRUE(gate_->check());
  std::ofstream(file()) << "{";
  EXPECT_EQ(ask_with("s-read", Method::get, "/v1/robots").status, 200U);
  EXPECT_EQ(ask_with("wrong", Method::get, "/v1/robots").status, 401U);
  ASSERT_FALSE(gate_->check());
  EXPECT_EQ(gate_->check().error().field, "auth.token_file");
  std::filesystem::remove(file());
  EXPECT_EQ(ask_with("wrong", Method::get, "/v1/robots").status, 401U);
  EXPECT_FALSE(gate_->check());
  EXPECT_FALSE(Gate::open({.token_file = file()}));
}

TEST_F(AccessTest, LimitsTokenToItsRobots) {
  add("yard", Role::admin, "s-yard", "amr-*");
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/robots/amr-1/state").status, 200U);
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/robots/tug-1/state").status, 403U);
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/missions?robot_id=amr-1").status, 200U);
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/missions?robot_id=amr-1,amr-2").status, 200U);
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/missions?robot_id=amr-1,tug-1").status, 403U);
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/missions?robot_id=tug-1").status, 403U);
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/missions").status, 403U) << "of the whole fleet";
  EXPECT_EQ(ask_with("s-yard", Method::get, "/v1/missions/7").status, 403U) << "robot unknown";
}

TEST_F(AccessTest, BrowserSignsInAndOut) {
  EXPECT_EQ(ask(Method::post, "/v1/session", "", "", R"({"token": "wrong"})").status, 401U);
  const Response in = ask(Method::post, "/v1/session", "", "", R"({"token": "s-plan"})");
  ASSERT_EQ(in.status, 200U) << in.body;
  EXPECT_EQ(json::parse(in.body).at("role"), "plan");
  const std::string set = header(in, "Set-Cookie");
  for (const char* attribute : {"; HttpOnly", "; SameSite=Strict", "; Path=/", "; Max-Age=43200"})
    EXPECT_NE(set.find(attribute), std::string::npos) << set;
  EXPECT_EQ(set.find("Secure"), std::string::npos);
  EXPECT_EQ(set.find("s-plan"), std::string::npos) << "the cookie must not contain the token";
  const std::string cookie = "other=1; " + set.substr(0, set.find(';'));
  EXPECT_EQ(ask(Method::get, "/v1/robots", "", cookie).status, 200U);
  EXPECT_EQ(ask(Method::put, "/v1/robots/7", "", cookie).status, 403U);
  EXPECT_EQ(ask(Method::get, "/v1/robots", "Bearer wrong", cookie).status, 401U)
      << "a header overrides the cookie";
  const Response out = ask(Method::del, "/v1/session", "", cookie);
  EXPECT_EQ(out.status, 204U);
  EXPECT_NE(header(out, "Set-Cookie").find("Max-Age=0"), std::string::npos);
  EXPECT_EQ(ask(Method::get, "/v1/robots", "", cookie).status, 401U);
}

TEST_F(AccessTest, SessionExpires) {
  const auto sign_in = [this] {
    const std::string set =
        header(ask(Method::post, "/v1/session", "", "", R"({"token": "s-plan"})"), "Set-Cookie");
    return set.substr(0, set.find(';'));
  };
  const std::string first = sign_in();
  now_us_ += 12LL * 3600 * 1'000'000 - 1;
  EXPECT_EQ(ask(Method::get, "/v1/robots", "", first).status, 200U);
  now_us_ += 1;
  EXPECT_EQ(ask(Method::get, "/v1/robots", "", first).status, 401U);
  const std::string second = sign_in();
  revoke("plan");
  EXPECT_EQ(ask(Method::get, "/v1/robots", "", second).status, 401U);
}

TEST_F(AccessTest, HttpsCookieIsSecure) {
  secure_ = true;
  EXPECT_NE(header(ask(Method::post, "/v1/session", "", "", R"({"token": "s-plan"})"), "Set-Cookie")
                .find("; Secure"),
            std::string::npos);
}

TEST_F(AccessTest, NoTokenFileAllowsEverything) {
  const auto open_gate = *Gate::open({});
  for (const Endpoint& row : router_->endpoints()) {
    Request request;
    EXPECT_FALSE(open_gate->refuse(row, request)) << row.operation_id;
  }
}

TEST_F(AccessTest, AuditsChangesBeforeAndAfter) {
  for (const auto& [method, path] : {std::pair{Method::put, "/v1/robots/7"},
                                     {Method::post, "/v1/robots/7/models"},
                                     {Method::post, "/v1/diagnoses"},
                                     {Method::del, "/v1/diagnoses/7"}}) {
    events_.clear();
    const Response answer = ask(method, path, "Bearer s-admin", "", method == Method::del ? "" : "{}");
    ASSERT_EQ(answer.status, 200U) << path << answer.body;
    ASSERT_EQ(events_.size(), 2U) << path;
    EXPECT_EQ(events_[0].actor, "admin");
    EXPECT_EQ(events_[0].address, "192.0.2.7");
    EXPECT_EQ(events_[0].request_id, "r-1");
    EXPECT_EQ(json::parse(events_[0].detail_json).at("path"), path);
    EXPECT_EQ(json::parse(events_[1].detail_json).at("status"), 200);
    EXPECT_EQ(events_[0].action, events_[1].action);
  }
  audit_open_ = false;
  EXPECT_EQ(ask(Method::put, "/v1/robots/7", "Bearer s-admin", "", "{}").status, 503U);
  EXPECT_TRUE(lost_.empty());  // no change was made
  (void)ask(Method::put, "/v1/robots/7", "Bearer s-read");
  EXPECT_EQ(lost_, std::vector<std::string>{"putRobot: stopping"});  // but this was rejected
}

TEST_F(AccessTest, AuditsRefusalsAndCountsFloods) {
  events_.clear();
  (void)ask(Method::put, "/v1/robots/7", "Bearer s-read");
  ASSERT_EQ(events_.size(), 1U);
  EXPECT_EQ(events_[0].actor, "read");
  EXPECT_EQ(events_[0].action, "putRobot");
  EXPECT_EQ(json::parse(events_[0].detail_json).at("status"), 403);
  (void)ask(Method::get, "/v1/robots", "Bearer wrong");
  EXPECT_EQ(events_[1].actor, "");
  for (int k = 0; k < 200; ++k) (void)ask(Method::get, "/v1/robots");
  EXPECT_EQ(events_.size(), 15U);  // of one address
  for (int k = 0; k < 200; ++k) {
    address_ = "192.0.2." + std::to_string(8 + k % 20);
    (void)ask(Method::get, "/v1/robots");
  }
  EXPECT_EQ(events_.size(), 60U);
  now_us_ += 60'000'000;
  (void)ask(Method::get, "/v1/robots");
  ASSERT_EQ(events_.size(), 62U);
  EXPECT_EQ(events_[60].action, "refusals_omitted");
  EXPECT_EQ(json::parse(events_[60].detail_json).at("count"), 342);
}

TEST_F(AccessTest, BoundsAuditedTexts) {
  events_.clear();
  const std::string secret = access::new_secret(), marks(3000, '"');
  (void)ask(Method::get, "/v1/robots/" + marks);
  (void)ask(Method::get,
            "/v1/robots?robot_id=" + marks + "&" + std::string(3000, 'k') + "=1&access_token=" + secret);
  (void)ask(Method::get, "/v1/robots/" + secret);
  (void)ask(Method::get, "/v1/missions?note=before-" + secret + "-behind");
  ASSERT_EQ(events_.size(), 4U);
  for (const AccessEvent& event : events_) {
    EXPECT_LT(event.detail_json.size(), 2000U);
    EXPECT_EQ(event.detail_json.find(secret.substr(3)), std::string::npos) << event.detail_json;
  }
  EXPECT_EQ(json::parse(events_[2].detail_json).at("path"), "/v1/robots/jc_...");
  EXPECT_EQ(json::parse(events_[3].detail_json).at("query").at("note"), "before-jc_...-behind");
}

TEST_F(AccessTest, BoundsSignInsOfOneToken) {
  const auto sign_in = [this](const std::string& secret) {
    return ask(Method::post, "/v1/session", "", "", R"({"token":")" + secret + R"("})");
  };
  const Response admin = sign_in("s-admin");
  const std::string cookie = header(admin, "Set-Cookie");
  const std::string value = cookie.substr(0, cookie.find(';'));
  events_.clear();
  int signed_in = 0;
  for (int k = 0; k < 12'000; ++k) {
    if (k % 60 == 0) now_us_ += 1'000'000;
    const Response answer = sign_in("s-read");
    EXPECT_TRUE(answer.status == 200 || answer.status == 429) << answer.status;
    signed_in += answer.status == 200 ? 1 : 0;
    (void)ask(Method::del, "/v1/session", "Bearer s-read");  // ends none
  }
  EXPECT_GT(signed_in, 100);
  EXPECT_LE(signed_in, 5 * 60);  // the 200 s touch 5 minutes at most
  EXPECT_EQ(static_cast<int>(events_.size()), signed_in);
  EXPECT_EQ(ask(Method::get, "/v1/robots", "", value).status, 200U) << "another token's session was ended";
}

TEST(Addresses, RejectNames) {
  EXPECT_TRUE(address_of("::1", "http.address").value().is_loopback());
  EXPECT_FALSE(address_of("192.0.2.7", "http.address").value().is_loopback());
  for (const char* name : {"localhost", ""})
    EXPECT_EQ(address_of(name, "http.address").error().field, "http.address") << name;
}

}  // namespace
}  // namespace joulecast::http
