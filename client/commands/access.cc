#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "access/robot_keys.h"
#include "access/sha256.h"
#include "access/token.h"
#include "base/host_clock.h"
#include "base/json_number.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "client/commands/option.h"
#include "client/commands/print.h"
#include "client/commands/table.h"
#include "history/audit.h"
#include "signals/ids.h"

// The commands token, key and audit. token creates and revokes the tokens of joulecastd's auth.token_file. It
// writes the file, not the store, which a running daemon locks; it works with and without one, and the first
// token requires none. key creates, lists and revokes the keys by which robots sign their telemetry, in
// joulecastd's ingest.key_file. audit lists and verifies the audit of a store.
namespace joulecast::client {
namespace {

using access::Token;

struct TokenOptions {
  std::string file, name;
  std::optional<std::string> robots;
  std::string role = "read";
  double days = 365;
};

Result<Exit> create_token(TokenOptions& options) {
  constexpr double microseconds_per_day = 86400e6;
  if (const Result<void> sound = access::check_token_name(options.name); !sound)
    return fail(sound.error().fault, "--name", sound.error().message);
  if (options.robots && options.robots->empty())
    return invalid("--robots", "must not be empty; without it the token is for all robots");
  if (!std::isfinite(options.days)) return invalid("--days", "must be a number");
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
  TRY(access::change_tokens(options.file, add));
  std::puts(secret.c_str());
  std::fputs("This is the token; it is not kept and cannot be shown again.\n", stderr);
  return Exit::ok;
}

Result<Exit> list_tokens(TokenOptions& options) {
  TRY_ASSIGN(const auto tokens, access::read_tokens(options.file));
  const std::int64_t now = host_utime_us();
  Json rows = Json::array();
  for (const Token& token : tokens)
    rows.push_back({{"name", token.name},
                    {"role", access::name(token.role)},
                    {"robots", token.robots.empty() ? "all" : token.robots},
                    {"created", format_utc(token.created_utime_us)},
                    {"expires", token.expires_utime_us == 0
                                    ? "never"
                                    : format_utc(token.expires_utime_us) +
                                          (access::has_expired(token, now) ? ", expired" : "")}});
  print_rows(rows, {{"name", "name"},
                    {"role", "role"},
                    {"robots", "robots"},
                    {"created (UTC)", "created"},
                    {"expires (UTC)", "expires"}});
  return Exit::ok;
}

Result<Exit> revoke_token(TokenOptions& options) {
  const auto remove = [&](std::vector<Token>& tokens) -> Result<void> {
    if (std::erase_if(tokens, [&](const Token& token) { return token.name == options.name; }) == 0)
      return fail(Fault::not_found, "--name", "no token has the name " + options.name);
    return {};
  };
  TRY(access::change_tokens(options.file, remove));
  return Exit::ok;
}

struct KeyOptions {
  std::string file, robot_id;
};

Result<Exit> create_key(KeyOptions& options) {
  if (!signals::is_valid_robot_id(options.robot_id))
    return invalid("--robot-id", "\"" + options.robot_id + "\" is no robot id");
  const std::string key = access::random_hex(access::robot_key_bytes);
  const auto add = [&](access::RobotKeys& keys) -> Result<void> {
    if (!keys.emplace(options.robot_id, access::from_hexadecimal(key).value()).second)
      return fail(Fault::conflict, "--robot-id", "has a key already; revoke it first");
    return {};
  };
  TRY(access::change_robot_keys(options.file, add));
  std::puts(key.c_str());
  return Exit::ok;
}

Result<Exit> list_keys(KeyOptions& options) {
  TRY_ASSIGN(const auto keys, access::read_robot_keys(options.file));
  for (const auto& [robot_id, key] : keys) fmt::print("{}\n", robot_id);
  return Exit::ok;
}

Result<Exit> revoke_key(KeyOptions& options) {
  const auto remove = [&](access::RobotKeys& keys) -> Result<void> {
    if (keys.erase(options.robot_id) == 0)
      return fail(Fault::not_found, "--robot-id", options.robot_id + " has no key");
    return {};
  };
  TRY(access::change_robot_keys(options.file, remove));
  return Exit::ok;
}

constexpr std::size_t hash_digits = 64;

struct AuditOptions {
  std::string store;
  std::optional<std::string> head;
};

void print_entry(const history::AuditEntry& entry) {
  const nlohmann::ordered_json line{
      {"id", entry.id},
      {"time", utc_text(entry.utime_us)},
      {"actor", entry.actor},
      {"address", entry.address},
      {"request_id", entry.request_id},
      {"action", entry.action},
      {"detail", nlohmann::ordered_json::parse(entry.detail_json, nullptr, false)},
      {"hash", entry.hash}};
  fmt::print("{}\n", json_text(line));
}

Result<Exit> list_audit(AuditOptions& options) {
  TRY(history::verify_audit(options.store, {}, print_entry));
  return Exit::ok;
}

Result<Exit> verify_audit(AuditOptions& options) {
  if (options.head && options.head->size() != hash_digits)
    return invalid("--head", "must be the 64 hexadecimal digits that an earlier verify printed");
  TRY_ASSIGN(const auto state, history::verify_audit(options.store, options.head.value_or("")));
  fmt::print("{} entries, every link is valid\n", state.entries);
  if (state.removed > 0) fmt::print("entries 1 to {} were removed by the retention\n", state.removed);
  if (state.entries > 0) fmt::print("head {}\n", state.head);
  return Exit::ok;
}

}  // namespace

void add_token(CLI::App& program, Exit& exit) {
  using O = TokenOptions;
  auto& group = add_group(program, "token", "Create, list and revoke the tokens that joulecastd requires");
  const Row<O> file{"--file", &O::file, "token file: the daemon's auth.token_file", file_of("json"),
                    required};
  add_command<O>(
      group, exit, "create", "Add a token and print it, once", create_token,
      {file,
       {"--name", &O::name, "name of the client that uses it, shown in the audit", named("NAME"), required},
       {"--role", &O::role,
        "read; plan: also plans and forecasts; operate: also adopts models and runs diagnoses; admin: also "
        "adds and removes robots",
        one_of({"read", "plan", "operate", "admin"})},
       {"--robots", &O::robots, "shell pattern of robot ids, such as amr-*; default: all", named("PATTERN")},
       {"--days", &O::days, "days until it expires; 0: never", between(0.0, 36500.0)}},
      "joulecast token create --file tokens.json --name dispatcher --role plan\n"
      "joulecast token create --file tokens.json --name yard --role operate --robots 'amr-*' --days 30");
  add_command<O>(group, exit, "list", "List the tokens, without their secrets", list_tokens, {file},
                 "joulecast token list --file tokens.json");
  add_command<O>(group, exit, "revoke", "Remove a token: requests with it are refused from now on",
                 revoke_token, {file, {"--name", &O::name, "name of the token", named("NAME"), required}},
                 "joulecast token revoke --file tokens.json --name yard");
}

void add_key(CLI::App& program, Exit& exit) {
  using O = KeyOptions;
  auto& group =
      add_group(program, "key", "Create, list and revoke the keys with which robots sign their telemetry");
  const Row<O> file{"--file", &O::file, "key file: the daemon's ingest.key_file", file_of("json"), required},
      robot{"robot,--robot-id", &O::robot_id, "robot that signs with the key", named("ROBOT"), required};
  add_command<O>(group, exit, "create",
                 "Add a robot's key and print it for its publisher; from now on only the robot's signed "
                 "telemetry is accepted",
                 create_key, {file, robot}, "joulecast key create amr-07 --file keys.json");
  add_command<O>(group, exit, "list", "List the robots that have keys", list_keys, {file},
                 "joulecast key list --file keys.json");
  add_command<O>(group, exit, "revoke",
                 "Remove a robot's key; from now on the robot is treated as one without a key", revoke_key,
                 {file, robot}, "joulecast key revoke --file keys.json --robot-id amr-07");
}

void add_audit(CLI::App& program, Exit& exit) {
  using O = AuditOptions;
  auto& group =
      add_group(program, "audit", "List and verify a store's audit: who changed what, and who was refused");
  const Row<O> store{"--store", &O::store, "SQLite file, sqlite:PATH or postgresql://...", file_of("db"),
                     required};
  add_command<O>(group, exit, "list",
                 "Print the entries up to the first invalid hash, one JSON object per line", list_audit,
                 {store}, "joulecast audit list --store history.db");
  add_command<O>(
      group, exit, "verify", "Find the first entry that was changed, removed or inserted", verify_audit,
      {store,
       {"--head", &O::head,
        "hash that an earlier verify printed: fail also if no entry has it, which detects a truncated log",
        named("HASH")}},
      "joulecast audit verify --store history.db");
}

}  // namespace joulecast::client
