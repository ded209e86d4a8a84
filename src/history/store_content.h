#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "history/sql.h"

// Consistency conditions of a store's rows, in any database.
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

}  // namespace joulecast::history
