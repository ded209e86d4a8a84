#include "access/token.h"

#include <fnmatch.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "access/secret_file.h"
#include "access/sha256.h"
#include "base/json_fields.h"
#include "base/text_file.h"
#include "base/try.h"
#include "base/utc_time.h"

namespace joulecast::access {
namespace {

using Json = nlohmann::json;

constexpr std::size_t longest_name = 64;
constexpr std::size_t longest_pattern = 128;
constexpr std::size_t hash_digits = 64;

Result<Token> read_token(const Json& object, const std::string& at) {
  if (!object.is_object()) return invalid(at, "must be an object");
  Fields fields(object, at);
  Token token;
  token.name = fields.text("name", longest_name);
  token.role = role_of(fields.choice("role", {"read", "plan", "operate", "admin"})).value_or(Role::read);
  token.robots = fields.text("robots", longest_pattern, "");
  token.created_utime_us = fields.time("created").value_or(0);
  token.expires_utime_us = fields.time("expires").value_or(0);
  token.sha256 = fields.text("sha256", hash_digits);
  if (fields.ok() && (token.sha256.size() != hash_digits ||
                      token.sha256.find_first_not_of("0123456789abcdef") != std::string::npos))
    fields.fault("sha256", "must be 64 hexadecimal digits");
  if (fields.ok())
    if (Result<void> sound = check_token_name(token.name); !sound)
      fields.fault("name", sound.error().message);
  TRY(fields.finish());
  return token;
}

}  // namespace

std::string new_secret() {
  return std::string(secret_prefix).append(random_hex(32));
}

const Token* find_token(const std::vector<Token>& tokens, std::string_view secret) {
  const std::string hash = sha256_hex(secret);
  const Token* found = nullptr;
  for (const Token& token : tokens)
    if (equal_in_constant_time(token.sha256, hash)) found = &token;
  return found;
}

bool has_expired(const Token& token, std::int64_t now_utime_us) {
  return token.expires_utime_us != 0 && now_utime_us >= token.expires_utime_us;
}

bool is_for_robot(const Token& token, const std::string& robot_id) {
  return token.robots.empty() || fnmatch(token.robots.c_str(), robot_id.c_str(), 0) == 0;
}

Result<void> check_token_name(std::string_view name) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("._-@").find(c) != std::string_view::npos;
  };
  if (name.empty() || name.size() > longest_name || !std::ranges::all_of(name, allowed))
    return invalid("name", "must be 1 to 64 of the letters, digits and ._-@");
  return {};
}

Result<std::vector<Token>> parse_tokens(std::string_view json_text) {
  TRY_ASSIGN(const auto list, read_list(json_text, "tokens"));
  std::vector<Token> tokens;
  for (const Json& each : list) {
    const std::string at = "/tokens/" + std::to_string(tokens.size());
    TRY_ASSIGN(Token token, read_token(each, at));
    if (std::ranges::find(tokens, token.name, &Token::name) != tokens.end())
      return invalid(at + "/name", "is " + token.name + ", which another token has");
    tokens.push_back(std::move(token));
  }
  return tokens;
}

std::string to_json_text(const std::vector<Token>& tokens) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Token& token : tokens) {
    nlohmann::ordered_json object{{"name", token.name}, {"role", name(token.role)}};
    if (!token.robots.empty()) object["robots"] = token.robots;
    object["created"] = utc_text(token.created_utime_us);
    if (token.expires_utime_us != 0) object["expires"] = utc_text(token.expires_utime_us);
    object["sha256"] = token.sha256;
    list.push_back(std::move(object));
  }
  return nlohmann::ordered_json{{"tokens", std::move(list)}}.dump(2) + "\n";
}

Result<std::vector<Token>> read_tokens(const std::string& path) {
  TRY_ASSIGN(const std::string text, read_guarded_file(path, false));
  Result<std::vector<Token>> tokens = parse_tokens(text);
  if (!tokens) return invalid(path, describe(tokens.error()));
  return tokens;
}

Result<void> change_tokens(const std::string& path,
                           const std::function<Result<void>(std::vector<Token>&)>& change) {
  return change_secret_file<std::vector<Token>>(path, read_tokens, to_json_text, change);
}

std::string_view name(Role role) {
  constexpr std::string_view names[] = {"open", "read", "plan", "operate", "admin", "unstated"};
  return names[static_cast<std::size_t>(role)];
}

std::optional<Role> role_of(std::string_view text) {
  for (const Role role : {Role::read, Role::plan, Role::operate, Role::admin})
    if (name(role) == text) return role;
  return std::nullopt;
}

}  // namespace joulecast::access
