#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "server/api/change.h"
#include "server/api/csv.h"
#include "tests/server/handled.h"

namespace joulecast::api {
namespace {

using namespace http;

// One endpoint that counts its executions, behind keys in memory.
class IdempotencyTest : public ::testing::Test {
 protected:
  IdempotencyTest() {
    Endpoint change;
    change.method = Method::post;
    change.path = "/things/{id}";
    change.operation_id = "changeThing";
    change.role = Role::operate;
    change.success_status = 202;
    change.handler = [this](const Request& request) -> Result<Response> {
      ++done_;
      asked_ = &request;
      if (meanwhile_) meanwhile_();
      if (elsewhere_ > 0 && elsewhere_--)
        return fail(Fault::conflict, std::string(idempotency_header), "is handled");
      if (refuses_) return fail(Fault::conflict, "id", "is done already");
      request.kept.committed = commits_;
      if (fails_) return fail(Fault::unavailable, "", "not now; not done");
      Response response = json_response("{\"done\": " + std::to_string(done_) + "}");
      response.status = 202;
      response.headers.emplace_back("Location", "/things/" + request.param("id"));
      return response;
    };
    Endpoint read;
    read.path = "/things";
    read.operation_id = "getThings";
    read.role = Role::read;
    read.handler = change.handler;
    std::vector<Endpoint> table;
    table.push_back(keys_.honoured(std::move(change)));
    router_ = std::make_unique<Router>(std::move(table));
    EXPECT_FALSE(takes_idempotency_key(read));
  }

  Response ask(const std::string& key, const std::string& actor = "ops", const std::string& body = "",
               const std::string& target = "/things/a") {
    Request request;
    request.method = Method::post;
    request.target = target;
    request.actor = actor;
    request.body = body;
    if (!key.empty()) request.headers.emplace_back("Idempotency-Key", key);
    return http::handled(*router_, request);
  }

  static std::string header(const Response& response, const std::string& name) {
    for (const auto& [each, value] : response.headers)
      if (each == name) return value;
    return "";
  }

  int done_ = 0;
  bool fails_ = false, readable_ = true, refuses_ = false, commits_ = false;
  int elsewhere_ = 0;  // how often another daemon is found to handle the key
  std::function<void()> meanwhile_;
  const Request* asked_ = nullptr;
  static constexpr std::chrono::milliseconds wait_{300};
  std::map<std::pair<std::string, std::string>, history::RequestAnswer> kept_;
  IdempotencyKeys keys_{
      {.find = [this](const std::string& actor,
                      const std::string& key) -> Result<std::optional<history::RequestAnswer>> {
         if (!readable_) return fail(Fault::unavailable, "store", "cannot be read");
         const auto found = kept_.find({actor, key});
         if (found == kept_.end()) return std::nullopt;
         return found->second;
       },
       .keep =
           [this](history::RequestAnswer answer) {
             kept_[{answer.actor, answer.key}] = answer;
           },
       .wait = wait_}};
  std::unique_ptr<Router> router_;
};

TEST_F(IdempotencyTest, RepetitionReturnsFirstAnswer) {
  const Response first = ask("k1");
  const Response again = ask("k1");
  EXPECT_EQ(done_, 1);
  EXPECT_EQ(again.status, 202u);
  EXPECT_EQ(again.body, first.body);
  EXPECT_EQ(header(again, "Location"), "/things/a");
  EXPECT_EQ(header(again, "Idempotency-Replayed"), "true");
  EXPECT_EQ(header(first, "Idempotency-Replayed"), "");
}

TEST_F(IdempotencyTest, KeysBelongToOneActor) {
  ask("k1");
  ask("k1", "someone else");
  EXPECT_EQ(done_, 2);
  ask("");
  ask("");
  EXPECT_EQ(done_, 4);
  EXPECT_EQ(kept_.size(), 2u);
}

TEST_F(IdempotencyTest, RejectsReusedKeys) {
  ask("k1");
  for (const Response& refused : {ask("k1", "ops", "{}"), ask("k1", "ops", "", "/things/b")}) {
    EXPECT_EQ(refused.status, 422u);
    EXPECT_NE(refused.body.find("Idempotency-Key"), std::string::npos) << refused.body;
  }
  EXPECT_EQ(done_, 1);
}

TEST_F(IdempotencyTest, FailedRequestCanBeRepeated) {
  fails_ = true;
  EXPECT_EQ(ask("k1").status, 503u);
  fails_ = false;
  EXPECT_EQ(ask("k1").status, 202u);
  EXPECT_EQ(done_, 2);
}

TEST_F(IdempotencyTest, RejectsRequestsWithoutStorage) {
  readable_ = false;
  EXPECT_EQ(ask("k1").status, 503u);
  EXPECT_EQ(done_, 0);
}

TEST_F(IdempotencyTest, AnswersWhatAnotherDaemonAnswered) {
  // Both had looked the key up before either was done; this one finds the change made.
  meanwhile_ = [this] {
    const Request& request = *asked_;
    kept_[{request.actor, "k1"}] = {request.actor, "k1", request.kept.fingerprint, 0,
                                    200,           "",   "{\"other\": 1}"};
  };
  refuses_ = true;
  const Response response = ask("k1");
  EXPECT_EQ(response.status, 200u);
  EXPECT_EQ(response.body, "{\"other\": 1}");
}

TEST_F(IdempotencyTest, WaitsForAnotherDaemonsAnswer) {
  elsewhere_ = 3;
  EXPECT_EQ(ask("k1").status, 202u);
  EXPECT_EQ(done_, 4);
  elsewhere_ = 1000;
  const auto began = std::chrono::steady_clock::now();
  EXPECT_EQ(ask("k2").status, 409u);
  EXPECT_GE(std::chrono::steady_clock::now() - began, wait_);
}

TEST_F(IdempotencyTest, KeepsNothingTwice) {
  commits_ = true;
  EXPECT_EQ(ask("k1").status, 202u);
  EXPECT_TRUE(kept_.empty()) << "the handler kept it with its change";
}

TEST_F(IdempotencyTest, ChecksKeySyntaxAndLength) {
  for (const std::string& key : {std::string(256, 'k'), std::string("a b"), std::string("\xc3\xa4")})
    EXPECT_EQ(ask(key).status, 422u) << key;
  EXPECT_EQ(done_, 0);
  EXPECT_EQ(ask(std::string(255, 'k')).status, 202u);
}

TEST(Csv, GuardsFormulae) {
  const auto written = [](const std::string& text) {
    Csv csv({}, "note");
    csv.field(text).end_row();
    const std::string body = csv.response("notes").body;
    return body.substr(body.find('\n') + 1);
  };
  for (const char* formula :
       {"=1+1", "+1", "-1", "@x", "\t=1", "\r=1", "\n=1", " =1", "\u00A0=1", "\u200B=1", "\u200B \uFEFF@x",
        "\uFF1D"
        "1",
        "\uFF0B"
        "1",
        "\uFF0D"
        "1",
        "\uFF20"
        "x"}) {
    const std::string row = written(formula);
    EXPECT_EQ(row.find('\''), row.starts_with('"') ? 1U : 0U) << row;
  }
  for (const char* plain : {"a=1", "1-1", " x", "", "'=1", "\u00E4"})
    EXPECT_EQ(written(plain), std::string(plain) + "\r\n") << plain;
}

}  // namespace
}  // namespace joulecast::api
