#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace joulecast::access {

// Permissions of a token, ascending: each role includes those before it. `open` needs no token; no token has
// the role `unstated`, so a request that states no role is rejected.
enum class Role : std::uint8_t { open, read, plan, operate, admin, unstated };

std::string_view name(Role role);

// One of the four roles that a token can have.
std::optional<Role> role_of(std::string_view name);

// A bearer token as it is kept: of the secret only its hash.
struct Token {
  std::string name = {};  // whom the audit names; unique in its file
  Role role = Role::read;
  std::string robots = {};            // shell pattern of the robot ids that it is for; empty: all
  std::int64_t created_utime_us = 0;  // since 1970
  std::int64_t expires_utime_us = 0;  // since 1970; 0: never
  std::string sha256 = {};            // of the secret

  friend bool operator==(const Token&, const Token&) = default;
};

inline constexpr std::string_view secret_prefix = "jc_";

// A new secret, the prefix and 64 hexadecimal digits: 256 random bits.
std::string new_secret();

// The token of that secret, compared with every one in constant time; null when none is. Also expired ones.
const Token* find_token(const std::vector<Token>& tokens, std::string_view secret);

bool has_expired(const Token& token, std::int64_t now_utime_us);
bool is_for_robot(const Token& token, const std::string& robot_id);

// 1 to 64 of the letters, digits and "._-@".
Result<void> check_token_name(std::string_view name);

// The file: {"tokens": [{"name", "role", "robots", "created", "expires", "sha256"}]}. Errors name the member.
Result<std::vector<Token>> parse_tokens(std::string_view json_text);
std::string to_json_text(const std::vector<Token>& tokens);

// Fault::not_found where there is no such file.
Result<std::vector<Token>> read_tokens(const std::string& path);

// Replaces the file as a whole and keeps its mode (a new one: 0640). Fault::conflict while another program
// writes it. `change` receives the present tokens; none without a file.
Result<void> change_tokens(const std::string& path,
                           const std::function<Result<void>(std::vector<Token>&)>& change);

}  // namespace joulecast::access
