#include "history/audit.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/json_number.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "client/commands/option.h"
#include "client/commands/table.h"

namespace joulecast::client {
namespace {

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
