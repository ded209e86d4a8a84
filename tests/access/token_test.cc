#include "access/token.h"

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "access/sha256.h"
#include "base/text_file.h"

namespace joulecast::access {
namespace {

class TokenFileTest : public ::testing::Test {
 protected:
  TokenFileTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "joulecast-access-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    path_ = (folder_ / "tokens.json").string();
  }
  ~TokenFileTest() override { std::filesystem::remove_all(folder_); }

  Result<void> add(const Token& token) {
    return change_tokens(path_, [&](std::vector<Token>& tokens) -> Result<void> {
      tokens.push_back(token);
      return {};
    });
  }

  std::filesystem::path folder_;
  std::string path_;
};

TEST(Sha256, MatchesFips180Vectors) {
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Role, RolesIncludeLowerOnes) {
  EXPECT_LT(Role::read, Role::plan);
  EXPECT_LT(Role::plan, Role::operate);
  EXPECT_LT(Role::operate, Role::admin);
  EXPECT_LT(Role::admin, Role::unstated);
  EXPECT_EQ(role_of("operate"), Role::operate);
  EXPECT_FALSE(role_of("open"));
  EXPECT_FALSE(role_of("unstated"));
}

TEST(Token, FindsTokenBySecretOnly) {
  const std::string secret = new_secret();
  EXPECT_EQ(secret.size(), 67U);
  EXPECT_NE(secret, new_secret());
  const std::vector<Token> tokens{{.name = "a", .sha256 = sha256_hex("other")},
                                  {.name = "b", .sha256 = sha256_hex(secret)}};
  ASSERT_NE(find_token(tokens, secret), nullptr);
  EXPECT_EQ(find_token(tokens, secret)->name, "b");
  EXPECT_EQ(find_token(tokens, sha256_hex(secret)), nullptr) << "the stored hash must not be a secret";
  EXPECT_EQ(find_token(tokens, ""), nullptr);
}

TEST(Token, ChecksExpiryAndRobots) {
  const Token token{.robots = "amr-*", .expires_utime_us = 100};
  EXPECT_FALSE(has_expired(token, 99));
  EXPECT_TRUE(has_expired(token, 100));
  EXPECT_FALSE(has_expired(Token{}, 1'000'000));
  EXPECT_TRUE(is_for_robot(token, "amr-7"));
  EXPECT_FALSE(is_for_robot(token, "tug-7"));
  EXPECT_TRUE(is_for_robot(Token{}, "tug-7"));
}

TEST_F(TokenFileTest, KeepsHashesAndNoSecrets) {
  const std::string secret = new_secret();
  const Token token{.name = "dispatcher",
                    .role = Role::plan,
                    .robots = "amr-*",
                    .created_utime_us = 1'790'000'000'000'000,
                    .expires_utime_us = 1'890'000'000'000'000,
                    .sha256 = sha256_hex(secret)};
  ASSERT_TRUE(add(token));
  const auto kept = read_tokens(path_);
  ASSERT_TRUE(kept) << describe(kept.error());
  EXPECT_EQ(*kept, std::vector{token});
  EXPECT_EQ(read_text_file(path_)->find(secret.substr(3)), std::string::npos);
  struct stat status {};
  ASSERT_EQ(stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0640U);
}

TEST_F(TokenFileTest, RejectsFileWritableByAll) {
  ASSERT_TRUE(add({.name = "a", .sha256 = sha256_hex("a")}));
  ASSERT_EQ(chmod(path_.c_str(), 0666), 0);
  EXPECT_EQ(read_tokens(path_).error().message, "may be written by every user of this machine: chmod o-w");
}

TEST_F(TokenFileTest, FailedChangeKeepsFile) {
  ASSERT_TRUE(add({.name = "a", .sha256 = sha256_hex("a")}));
  const auto refused = change_tokens(path_, [](std::vector<Token>& tokens) -> Result<void> {
    tokens.clear();
    return invalid("--name", "refused");
  });
  EXPECT_FALSE(refused);
  EXPECT_EQ(read_tokens(path_)->size(), 1U);
  EXPECT_FALSE(std::filesystem::exists(path_ + ".new"));
  std::ofstream(path_ + ".new") << "of another program";
  const auto busy = add({.name = "b", .sha256 = sha256_hex("b")});
  ASSERT_FALSE(busy);
  EXPECT_EQ(busy.error().fault, Fault::conflict);
  EXPECT_TRUE(std::filesystem::exists(path_ + ".new")) << "files of other programs must not be deleted";
}

TEST(TokenText, ErrorsNameTheMember) {
  const auto fault = [](std::string_view text) {
    const auto tokens = parse_tokens(text);
    return tokens ? std::string("none") : tokens.error().field;
  };
  const std::string hash(64, 'a');
  const auto one = [&](const std::string& members) {
    return R"({"tokens": [{"name": "a", "role": "read", "sha256": ")" + hash + "\"" + members + "}]}";
  };
  EXPECT_EQ(fault(one("")), "none");
  EXPECT_EQ(fault("{}"), "/tokens");
  EXPECT_EQ(fault(one(R"(, "rolle": 1)")), "/tokens/0/rolle");
  EXPECT_EQ(fault(R"({"tokens": [{"name": "a", "role": "root", "sha256": ")" + hash + "\"}]}"),
            "/tokens/0/role");
  EXPECT_EQ(fault(R"({"tokens": [{"name": "a b", "role": "read", "sha256": ")" + hash + "\"}]}"),
            "/tokens/0/name");
  EXPECT_EQ(fault(R"({"tokens": [{"name": "a", "role": "read", "sha256": "aa"}]})"), "/tokens/0/sha256");
  const std::string token = R"({"name": "a", "role": "read", "sha256": ")" + hash + "\"}";
  EXPECT_EQ(fault("{\"tokens\": [" + token + "," + token + "]}"), "/tokens/1/name");
}

}  // namespace
}  // namespace joulecast::access
