#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "history/sql.h"

// Whole stores, table by table: copied into another database, counted, examined. For open_tables().
namespace joulecast::history {

inline constexpr std::size_t max_faults = 100;

struct ContentReport {
  std::int64_t missions = 0;
  std::int64_t ledgers = 0;         // added up
  double worst_residual_j = 0;      // of a ledger: its sum less the battery's energy
  std::int64_t chunks = 0;          // of telemetry and covariates, decoded
  std::vector<std::string> faults;  // descriptions, a line each, at most max_faults
  std::int64_t fault_count = 0;

  void add_fault(std::string text);
};

// Checks every mission's record, the sum of its ledger, every chunk of telemetry and covariates against its
// row, and every link of the audit. Damage is reported as a fault, and the rest is still read. Throws
// SqlError if the database cannot be queried.
ContentReport check_content(Database& database);

// Summary of a table. Equal rows have equal checksums in every database: FNV-1a over the values in key order.
struct TableSummary {
  std::string table;
  std::int64_t rows = 0;
  std::int64_t value_bytes = 0;  // of numbers 8 each, of texts and blobs their lengths
  std::uint64_t checksum = 0;

  bool operator==(const TableSummary&) const = default;
};

// Called now and then: the table, its rows done and its rows in all.
using TableProgress = std::function<void(std::string_view table, std::int64_t done, std::int64_t rows)>;

struct CopyReport {
  std::vector<TableSummary> tables;
  std::int64_t rows_found = 0;  // that an earlier copy had brought
};

// Copies every row. Continues an interrupted copy of the same store: the rows in the destination must be the
// beginning of the source's, otherwise it is a Fault::conflict. Counts and checksums of every table are read
// back from both and compared: Fault::corrupt if they differ.
Result<CopyReport> copy_tables(Database& from, Database& to, const TableProgress& progress);

Result<std::vector<TableSummary>> summarize_tables(Database& database, const TableProgress& progress);

struct VerifyReport : ContentReport {
  std::vector<TableSummary> tables;
};

// Reads every row of every table and checks their content.
Result<VerifyReport> verify_tables(Database& database, const TableProgress& progress);

}  // namespace joulecast::history
