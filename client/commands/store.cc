#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/try.h"
#include "client/commands/option.h"
#include "client/commands/print.h"
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

Json to_json(const std::vector<TableSummary>& tables) {
  Json all = Json::array();
  for (const TableSummary& table : tables)
    all.push_back({{"table", table.table},
                   {"rows", table.rows},
                   {"value_bytes", table.value_bytes},
                   {"checksum", fmt::format("{:016x}", table.checksum)}});
  return all;
}

void print_tables(const Json& document) {
  print_rows(
      document["tables"],
      {{"table", "table"}, {"rows", "rows", 0}, {"bytes", "value_bytes", 0}, {"checksum", "checksum"}});
}

// The error with the option that named the store.
template <class T>
Result<T> of_option(Result<T> result, const char* option) {
  const std::string field = result ? "" : result.error().field;
  if (field == "url" || field == "database" || field == "to") result.error().field = option;
  return result;
}

Result<Exit> copy(StoreOptions& options) {
  std::error_code none;
  if (options.to == options.from ||
      std::filesystem::equivalent(history::sqlite_path(options.to), history::sqlite_path(options.from), none))
    return invalid("--to", "is the store of --from");
  TRY_ASSIGN(const auto from, of_option(history::open_tables(options.from, true), "--from"));
  TRY_ASSIGN(const auto to, of_option(history::open_tables(options.to, false), "--to"));
  TableLines lines("copying");
  TRY_ASSIGN(const auto copied, of_option(history::copy_tables(*from, *to, lines.progress()), "--to"));
  const Json document{{"tables", to_json(copied.tables)}, {"rows_found", copied.rows_found}};
  if (options.json) {
    print_json(document);
    return Exit::ok;
  }
  print_tables(document);
  if (copied.rows_found > 0) fmt::print("{} rows were already in the destination\n", copied.rows_found);
  fmt::print("every table is equal in both stores\n");
  return Exit::ok;
}

template <class T>
Result<T> read(const StoreOptions& options,
               Result<T> (*work)(history::Database&, const history::TableProgress&)) {
  TRY_ASSIGN(const auto store, of_option(history::open_tables(options.from, true), "--store"));
  TableLines lines("reading");
  return of_option(work(*store, lines.progress()), "--store");
}

Result<Exit> verify_store(StoreOptions& options) {
  TRY_ASSIGN(const auto found, read(options, &history::verify_tables));
  const Json document{{"tables", to_json(found.tables)}, {"missions", found.missions},
                      {"ledgers", found.ledgers},        {"worst_residual_j", found.worst_residual_j},
                      {"chunks", found.chunks},          {"faults", found.faults},
                      {"fault_count", found.fault_count}};
  if (options.json) {
    print_json(document);
  } else {
    print_tables(document);
    fmt::print("{} missions; {} ledgers add up, the worst within {:.2g} J; {} chunks decoded; {} faults\n",
               found.missions, found.ledgers, found.worst_residual_j, found.chunks, found.fault_count);
    for (const std::string& fault : found.faults) fmt::print("{}\n", fault);
  }
  return found.fault_count == 0 ? Exit::ok : Exit::fault;
}

Result<Exit> stats(StoreOptions& options) {
  TRY_ASSIGN(const auto tables, read(options, &history::summarize_tables));
  const Json document{{"tables", to_json(tables)}};
  options.json ? print_json(document) : print_tables(document);
  return Exit::ok;
}

}  // namespace

void add_store(CLI::App& program, Exit& exit) {
  using O = StoreOptions;
  auto& group =
      add_group(program, "store", "Copy, verify or summarise a whole history that no daemon has open");
  const auto place = [](const char* name, std::string O::*member, const char* help) {
    return Row<O>{name, member, help, file_of("db"), required};
  };
  constexpr const char* which = "SQLite file, sqlite:PATH or postgresql://...";
  const Row<O> store = place("--store", &O::from, which),
               json{"--json", &O::json, "print the report as JSON"};
  add_command<O>(group, exit, "copy", "Copy every table into another database; continue an interrupted copy",
                 copy,
                 {place("--from", &O::from, which),
                  place("--to", &O::to, "the same; created if it does not exist"), json},
                 "joulecast store copy --from history.db --to copy.db");
  add_command<O>(group, exit, "verify",
                 "Read and check everything: records, the sums of ledgers, chunks of telemetry", verify_store,
                 {store, json}, "joulecast store verify --store history.db");
  add_command<O>(group, exit, "stats", "Print rows, bytes and checksums of every table", stats, {store, json},
                 "joulecast store stats --store history.db --json");
}

}  // namespace joulecast::client
