#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/try.h"
#include "client/commands/table.h"
#include "client/progress.h"
#include "history/open_store.h"
#include "history/sql.h"
#include "history/store_copy.h"

namespace joulecast::client {
namespace {

using history::TableSummary;

struct StoreOptions {
  std::string from, to;
  bool json = false;
};

// A line of progress a table.
class TableLines {
 public:
  explicit TableLines(std::string work) : work_(std::move(work)) {}

  history::TableProgress progress() {
    return [this](std::string_view table, std::int64_t done, std::int64_t rows) {
      if (table != table_ || static_cast<std::uint64_t>(done) < done_) {
        line_.emplace(work_ + " " + std::string(table), "rows", static_cast<std::uint64_t>(rows));
        table_ = table;
      }
      done_ = static_cast<std::uint64_t>(done);
      line_->reach(done_);
    };
  }

 private:
  std::string work_, table_;
  std::uint64_t done_ = 0;
  std::optional<Progress> line_;
};

nlohmann::json to_json(const std::vector<TableSummary>& tables) {
  nlohmann::json all = nlohmann::json::array();
  for (const TableSummary& table : tables)
    all.push_back({{"table", table.table},
                   {"rows", table.rows},
                   {"value_bytes", table.value_bytes},
                   {"checksum", fmt::format("{:016x}", table.checksum)}});
  return all;
}

void print_tables(const std::vector<TableSummary>& tables) {
  fmt::print("{:<18} {:>12} {:>16} {:>18}\n", "table", "rows", "bytes", "checksum");
  for (const TableSummary& table : tables)
    fmt::print("{:<18} {:>12} {:>16} {:>18}\n", table.table, table.rows, table.value_bytes,
               fmt::format("{:016x}", table.checksum));
}

void print_store_report(const StoreOptions& options, const nlohmann::json& document) {
  if (options.json) std::puts(document.dump(2).c_str());
}

// On the option that named the store.
Exit report_of(Error error, const char* option) {
  if (error.field == "url" || error.field == "database") error.field = option;
  return report(error);
}

Exit copy(const StoreOptions& options) {
  const auto from = history::open_tables(options.from, true);
  if (!from) return report_of(from.error(), "--from");
  const auto to = history::open_tables(options.to, false);
  if (!to) return report_of(to.error(), "--to");
  TableLines lines("copying");
  const auto copied = history::copy_tables(**from, **to, lines.progress());
  if (!copied) return report_of(copied.error(), "--to");
  print_store_report(options, {{"tables", to_json(copied->tables)}, {"rows_found", copied->rows_found}});
  if (options.json) return Exit::ok;
  print_tables(copied->tables);
  if (copied->rows_found > 0) fmt::print("{} rows were there from an earlier copy\n", copied->rows_found);
  fmt::print("every table reads back the same from both\n");
  return Exit::ok;
}

template <class T>
Result<T> read(const StoreOptions& options,
               Result<T> (*work)(history::Database&, const history::TableProgress&)) {
  TRY_ASSIGN(const auto store, history::open_tables(options.from, true));
  TableLines lines("reading");
  return work(*store, lines.progress());
}

Exit verify_store(const StoreOptions& options) {
  const auto found = read(options, &history::verify_tables);
  if (!found) return report_of(found.error(), "--store");
  print_store_report(options, {{"tables", to_json(found->tables)},
                               {"missions", found->missions},
                               {"ledgers", found->ledgers},
                               {"worst_residual_j", found->worst_residual_j},
                               {"chunks", found->chunks},
                               {"faults", found->faults},
                               {"fault_count", found->fault_count}});
  if (!options.json) {
    print_tables(found->tables);
    fmt::print("{} missions; {} ledgers add up, the worst within {:.2g} J; {} chunks decoded; {} faults\n",
               found->missions, found->ledgers, found->worst_residual_j, found->chunks, found->fault_count);
    for (const std::string& fault : found->faults) fmt::print("{}\n", fault);
  }
  return found->fault_count == 0 ? Exit::ok : Exit::fault;
}

Exit stats(const StoreOptions& options) {
  const auto tables = read(options, &history::summarize_tables);
  if (!tables) return report_of(tables.error(), "--store");
  print_store_report(options, {{"tables", to_json(*tables)}});
  if (!options.json) print_tables(*tables);
  return Exit::ok;
}

}  // namespace

void add_store(CLI::App& program, Exit& exit) {
  auto* store =
      program.add_subcommand("store", "Copy, verify and count whole histories that no daemon has open");
  store->require_subcommand(1);
  constexpr const char* which = "SQLite file, sqlite:PATH or postgresql://...";
  const auto add = [&](const char* name, const char* help, Exit (*run)(const StoreOptions&)) {
    auto options = std::make_shared<StoreOptions>();
    auto* command = store->add_subcommand(name, help);
    const bool copies = run == &copy;
    command->add_option(copies ? "--from" : "--store", options->from, which)->required();
    if (copies) command->add_option("--to", options->to, "the same; created when absent")->required();
    command->add_flag("--json", options->json, "print the report as JSON");
    command->callback([options, run, &exit] { exit = run(*options); });
  };
  add("copy", "Copy every table into another database; go on where an earlier copy was cut off", copy);
  add("verify", "Read everything: records, the sums of ledgers, chunks of telemetry", verify_store);
  add("stats", "Rows, bytes and checksums of every table", stats);
}

}  // namespace joulecast::client
