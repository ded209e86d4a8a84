#include "history/audit.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/utc_time.h"
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
  fmt::print("{}\n", line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

Exit list_audit(const AuditOptions& options) {
  const auto state = history::verify_audit(options.store, {}, print_entry);
  return state ? Exit::ok : report(state.error());
}

Exit verify_audit(const AuditOptions& options) {
  if (options.head && options.head->size() != hash_digits)
    return report(
        {Fault::invalid, "--head", "must be the 64 hexadecimal digits that an earlier verify printed"});
  const auto state = history::verify_audit(options.store, options.head.value_or(""));
  if (!state) return report(state.error());
  fmt::print("{} entries, every link holds\n", state->entries);
  if (state->removed > 0) fmt::print("entries 1 to {} were removed by the retention\n", state->removed);
  if (state->entries > 0) fmt::print("head {}\n", state->head);
  return Exit::ok;
}

}  // namespace

void add_audit(CLI::App& program, Exit& exit) {
  auto* group = program.add_subcommand(
      "audit", "List and verify a store's audit: who changed what, and who was refused");
  group->require_subcommand(1);
  auto options = std::make_shared<AuditOptions>();
  const auto add = [&](const char* name, const char* what, Exit (*run)(const AuditOptions&)) {
    auto* command = group->add_subcommand(name, what);
    command->add_option("--store", options->store, "SQLite file, sqlite:PATH or postgresql://...")
        ->required();
    command->callback([options, run, &exit] { exit = run(*options); });
    return command;
  };
  add("list", "Print the entries up to the first invalid hash, one JSON object per line", list_audit);
  add("verify", "Find the first entry that was changed, removed or inserted", verify_audit)
      ->add_option(
          "--head", options->head,
          "hash that an earlier verify printed: fail also if no entry has it, which detects a truncated log");
}

}  // namespace joulecast::client
