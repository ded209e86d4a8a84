#include "access/token.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "access/sha256.h"
#include "base/host_clock.h"
#include "base/utc_time.h"
#include "client/commands/accepts.h"
#include "client/commands/on_file.h"
#include "client/commands/table.h"

// The command token: creates and revokes the tokens of joulecastd's auth.token_file. It writes the file, not
// the store, which a running daemon locks; it works with and without a running daemon, and the first token
// requires none.
namespace joulecast::client {
namespace {

using access::Token;

struct TokenOptions {
  std::string file, name;
  std::optional<std::string> robots;
  std::string role = "read";
  double days = 365;
};

Exit create_token(const TokenOptions& options) {
  constexpr double microseconds_per_day = 86400e6;
  if (const Result<void> sound = access::check_token_name(options.name); !sound)
    return report({sound.error().fault, "--name", sound.error().message});
  if (options.robots && options.robots->empty())
    return report({Fault::invalid, "--robots", "must not be empty; without it the token is for all robots"});
  if (!std::isfinite(options.days)) return report({Fault::invalid, "--days", "must be a number"});
  const std::string secret = access::new_secret();
  Token token;
  token.name = options.name;
  token.role = access::role_of(options.role).value_or(access::Role::read);
  token.robots = options.robots.value_or("");
  token.created_utime_us = host_utime_us();
  if (options.days > 0)
    token.expires_utime_us =
        token.created_utime_us + static_cast<std::int64_t>(options.days * microseconds_per_day);
  token.sha256 = access::sha256_hex(secret);
  const auto add = [&](std::vector<Token>& tokens) -> Result<void> {
    if (std::ranges::find(tokens, token.name, &Token::name) != tokens.end())
      return fail(Fault::conflict, "--name",
                  "a token has the name " + token.name + " already; revoke it or choose another");
    tokens.push_back(std::move(token));
    return {};
  };
  if (const Result<void> done = access::change_tokens(options.file, add); !done) return report(done.error());
  std::puts(secret.c_str());
  std::fputs("This is the token; it is not kept and cannot be shown again.\n", stderr);
  return Exit::ok;
}

Exit list_tokens(const TokenOptions& options) {
  const Result<std::vector<Token>> tokens = access::read_tokens(options.file);
  if (!tokens) return report(tokens.error());
  const std::int64_t now = host_utime_us();
  fmt::print("{:<24} {:<8} {:<20} {:<16} {:<16}\n", "name", "role", "robots", "created (UTC)",
             "expires (UTC)");
  for (const Token& token : *tokens)
    fmt::print("{:<24} {:<8} {:<20} {:<16} {:<16}\n", token.name, access::name(token.role),
               token.robots.empty() ? "all" : token.robots, format_utc(token.created_utime_us),
               token.expires_utime_us == 0 ? "never"
                                           : format_utc(token.expires_utime_us) +
                                                 (access::has_expired(token, now) ? ", expired" : ""));
  return Exit::ok;
}

Exit revoke_token(const TokenOptions& options) {
  const auto remove = [&](std::vector<Token>& tokens) -> Result<void> {
    if (std::erase_if(tokens, [&](const Token& token) { return token.name == options.name; }) == 0)
      return fail(Fault::not_found, "--name", "no token has the name " + options.name);
    return {};
  };
  if (const Result<void> done = access::change_tokens(options.file, remove); !done)
    return report(done.error());
  return Exit::ok;
}

}  // namespace

void add_token(CLI::App& program, Exit& exit) {
  auto* group = program.add_subcommand("token", "Make and revoke the tokens that a joulecastd requires");
  group->require_subcommand(1);
  FileCommands<TokenOptions> options(*group, "the file that the daemon's auth.token_file names", exit);
  auto* creating = options.add("create", "Add a token, and print it this once", create_token);
  creating->add_option("--name", options->name, "who or what uses it, as the audit will show")->required();
  creating
      ->add_option("--role", options->role,
                   "read; plan: also plans and forecasts; operate: also adopts models and runs diagnoses; "
                   "admin: also gives robots their models")
      ->check(one_of({"read", "plan", "operate", "admin"}))
      ->capture_default_str();
  creating->add_option("--robots", options->robots,
                       "shell pattern of the robot ids that it is for, as amr-*; otherwise all");
  creating->add_option("--days", options->days, "days until it expires; 0: never")
      ->check(between(0.0, 36500.0))
      ->capture_default_str();
  options.add("list", "List the tokens, without their secrets", list_tokens);
  options.add("revoke", "Remove a token: requests with it are refused from now on", revoke_token)
      ->add_option("--name", options->name, "the token's")
      ->required();
}

}  // namespace joulecast::client
