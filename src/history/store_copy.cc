#include "history/store_copy.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>
#include <utility>
#include <variant>

#include "base/text.h"
#include "base/try.h"
#include "history/audit.h"
#include "history/chunk_codec.h"
#include "history/mission_days.h"
#include "history/schema.h"
#include "history/sql_rows.h"
#include "history/sql_store.h"

namespace joulecast::history {
namespace {

// All but those that identify a store and its spools: a copy is a store of its own. No row comes before one
// that it refers to, but for a robot's active version.
std::vector<const Table*> copied_tables() {
  std::vector<const Table*> copied;
  for (const Table& table : store_tables())
    if (table.name != "joulecast_store" && table.name != "taken_spool") copied.push_back(&table);
  return copied;
}

// Rows to be read in one query and written in one transaction: about 8 MB of them, at the size of those done.
std::int64_t batch_rows(const TableSummary& done) {
  constexpr std::int64_t bytes = 8'000'000, least = 10, most = 2000;
  return done.rows == 0 ? least : std::clamp(bytes / (done.value_bytes / done.rows + 1), least, most);
}

using Key = std::vector<std::variant<std::int64_t, std::string>>;

// The key's columns first, then the others by name, so that equal rows have equal checksums whatever the
// order in which the columns were added.
std::vector<std::string> ordered_columns(const Table& table) {
  std::vector<std::string> columns = table.key, others;
  for (const auto& [name, type] : table.columns)
    if (std::ranges::find(table.key, name) == table.key.end()) others.push_back(name);
  std::ranges::sort(others);
  columns.insert(columns.end(), others.begin(), others.end());
  return columns;
}

std::string joined(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

std::int64_t rows_of(Database& database, const Table& table) {
  return database.integer("SELECT count(*) FROM " + table.name);
}

// Visits the next rows by key, at most `limit`, and moves the key on; returns their number, 0 at the end.
template <class Visit>
std::int64_t scan(Database& database, const Table& table, const std::vector<std::string>& columns, Key& after,
                  std::int64_t limit, Visit visit) {
  const std::string key = joined(table.key);
  const std::string beyond = " WHERE (" + key + ") > (" + placeholders(key) + ")";
  Statement& select = database.statement("SELECT " + joined(columns) + " FROM " + table.name +
                                         (after.empty() ? "" : beyond) + " ORDER BY " + key + " LIMIT ?");
  Rows rows(select);
  for (const auto& part : after) std::visit([&](const auto& value) { rows.bind(value); }, part);
  rows.bind(limit);
  std::int64_t count = 0;
  Key last;
  for (; rows.next(); ++count) {
    visit(select);
    last.clear();
    for (int k = 0; k < static_cast<int>(table.key.size()); ++k)
      select.type(k) == Statement::Type::integer ? last.emplace_back(select.integer(k))
                                                 : last.emplace_back(std::string(select.bytes(k)));
  }
  if (count > 0) after = last;
  return count;
}

// Adds rows up to a TableSummary.
class Summary {
 public:
  explicit Summary(std::string_view table) { sum_.table = table; }

  void add(const Statement& row, int skipped_column) {
    for (int k = 0; k < row.columns(); ++k)
      if (k != skipped_column) add_value(row, k);
    ++sum_.rows;
  }
  TableSummary get() const {
    TableSummary sum = sum_;
    sum.checksum = hash_;
    return sum;
  }

 private:
  void add_value(const Statement& row, int column) {
    const Statement::Type type = row.type(column);
    mix(static_cast<std::uint64_t>(type), 1);
    if (type == Statement::Type::integer) {
      mix(static_cast<std::uint64_t>(row.integer(column)), 8);
    } else if (type == Statement::Type::real) {
      const double value = row.real(column);
      mix(std::bit_cast<std::uint64_t>(value == 0 ? 0.0 : value), 8);  // SQLite keeps no sign of a zero
    } else if (type != Statement::Type::null) {
      const std::string_view bytes = row.bytes(column);
      mix(bytes.size(), 8);
      hash_ = fnv1a(bytes, hash_);
      sum_.value_bytes += static_cast<std::int64_t>(bytes.size());
      return;
    }
    if (type != Statement::Type::null) sum_.value_bytes += 8;
  }
  void mix(std::uint64_t value, unsigned bytes) {
    hash_ = fnv1a({reinterpret_cast<const char*>(&value), bytes}, hash_);  // the low bytes come first
  }

  TableSummary sum_;
  std::uint64_t hash_ = fnv1a({});
};

int index_of(const std::vector<std::string>& columns, std::string_view name) {
  const auto found = std::find(columns.begin(), columns.end(), name);
  return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
}

// Of the first `rows` rows; `after` becomes the last one's key.
TableSummary summarize(Database& database, const Table& table, std::int64_t rows, int skipped_column,
                       Key& after, const TableProgress& progress) {
  const std::vector<std::string> columns = ordered_columns(table);
  Summary summary(table.name);
  while (summary.get().rows < rows) {
    const std::int64_t limit = std::min(batch_rows(summary.get()), rows - summary.get().rows);
    const std::int64_t got = scan(database, table, columns, after, limit,
                                  [&](const Statement& row) { summary.add(row, skipped_column); });
    if (got == 0) break;
    progress(table.name, summary.get().rows, rows);
  }
  return summary.get();
}

TableSummary summarize(Database& database, const Table& table, const TableProgress& progress) {
  Key after;
  return summarize(database, table, rows_of(database, table), -1, after, progress);
}

void bind_column(Rows& to, const Statement& from, int column) {
  using enum Statement::Type;
  const Statement::Type type = from.type(column);
  if (type == null) to.bind_null();
  if (type == integer) to.bind(from.integer(column));
  if (type == real) to.bind(from.real(column));
  if (type == text) to.bind(from.bytes(column));
  if (type == blob) to.bind(std::as_bytes(std::span(from.bytes(column))));
}

// Robots before their models: which one is active comes when both are there. Answers the rows found.
Result<std::int64_t> copy_table(Database& from, Database& to, const Table& table,
                                const TableProgress& progress) {
  const std::vector<std::string> columns = ordered_columns(table);
  const int later = table.name == "robot" ? index_of(columns, "active_version") : -1;
  const std::int64_t rows = rows_of(from, table), found = rows_of(to, table);
  const auto quietly = [](std::string_view, std::int64_t, std::int64_t) {};
  Key after, same;
  if (found > rows || summarize(from, table, found, later, after, quietly) !=
                          summarize(to, table, found, later, same, quietly))
    return fail(Fault::conflict, "to",
                "table " + table.name + " holds rows that are not the beginning of the copied table");
  const std::string insert = insert_into(table.name, joined(columns));
  Summary copied(table.name);
  for (std::int64_t done = found; done < rows;) {
    Transaction transaction(to, Database::Access::write);
    const std::int64_t got =
        scan(from, table, columns, after, batch_rows(copied.get()), [&](const Statement& row) {
          copied.add(row, later);
          Rows target(to, insert);
          for (int k = 0; k < row.columns(); ++k)
            k == later ? void(target.bind_null()) : bind_column(target, row, k);
          target.run_later();
        });
    transaction.commit();
    if (got == 0) break;
    done += got;
    progress(table.name, done, rows);
  }
  return found;
}

void copy_active_versions(Database& from, Database& to) {
  const auto select = from.prepare("SELECT robot_id, active_version FROM robot ORDER BY robot_id");
  Transaction transaction(to, Database::Access::write);
  Rows rows(*select);
  while (rows.next()) {
    const std::string robot_id = rows.text();
    Rows(to, "UPDATE robot SET active_version = ? WHERE robot_id = ?", rows.optional_integer(), robot_id)
        .run_later();
  }
  transaction.commit();
}

class ContentCheck {
 public:
  explicit ContentCheck(Database& database) : database_(database) {}

  ContentReport run() {
    pages([this](std::int64_t after) { return missions(after); });
    pages([this](std::int64_t after) { return chunks("telemetry_chunk", "samples", after, decode_chunk); });
    pages([this](std::int64_t after) {
      return chunks("covariate_chunk", "changes", after, decode_covariates);
    });
    section([this] {
      if (const auto audit = verify_audit(database_, "audit"); !audit)
        report_.add_fault(audit.error().message);
    });
    return std::move(report_);
  }

 private:
  // Damage that prevents reading is reported as a fault.
  template <class Work>
  void section(Work work) {
    try {
      work();
    } catch (const SqlError& error) {
      if (error.fault() != Fault::corrupt) throw;
      report_.add_fault(error.what());
    }
  }

  // A page answers the last key that it read, or the one that it began after when there is no more.
  template <class Page>
  void pages(Page page) {
    section([&] {
      for (std::int64_t after = 0, last = page(after); last != after; last = page(after)) after = last;
    });
  }

  std::int64_t missions(std::int64_t after) {
    static const std::string sql = "SELECT mission_key, " + columns_of<Mission>() +
                                   " FROM mission WHERE mission_key > ? ORDER BY mission_key LIMIT 500";
    Rows rows(database_, sql, after);
    while (rows.next()) {
      ++report_.missions;
      after = rows.integer();
      if (const auto mission = read_record<Mission>(rows))
        add_ledger(*mission);
      else
        report_.add_fault("mission " + std::to_string(after) + ": " + describe(mission.error()));
    }
    return after;
  }

  // Ledgers are sums of many rounded steps, so their residual is compared with the magnitude of their terms.
  void add_ledger(const Mission& mission) {
    const auto& ledger = mission.accounts.ledger;
    const double residual_j = std::abs(ledger.total() - mission.accounts.battery_j);
    if (std::isnan(residual_j)) return;  // not available
    ++report_.ledgers;
    report_.worst_residual_j = std::max(report_.worst_residual_j, residual_j);
    double scale_j = 1;
    for (const double term_j : ledger.value) scale_j += std::abs(term_j);
    constexpr double closes = 1e-6;
    if (residual_j > closes * scale_j)
      report_.add_fault("mission " + std::to_string(mission.key) + ": its ledger adds up to " +
                        std::to_string(ledger.total()) + " J, and " +
                        std::to_string(mission.accounts.battery_j) + " J left the battery");
  }

  template <class Decode>
  std::int64_t chunks(const std::string& table, const std::string& items, std::int64_t after, Decode decode) {
    Rows rows(database_,
              "SELECT chunk_key, mission_key, " + items + ", start_utime_us, end_utime_us, body FROM " +
                  table + " WHERE chunk_key > ? ORDER BY chunk_key LIMIT 200",
              after);
    while (rows.next()) {
      after = rows.integer();
      const std::int64_t mission = rows.integer(), count = rows.integer(), start = rows.integer(),
                         end = rows.integer();
      const auto decoded = decode(rows.blob());
      const std::string which =
          table + " " + std::to_string(after) + " of mission " + std::to_string(mission);
      ++report_.chunks;
      if (!decoded) {
        report_.add_fault(which + ": " + describe(decoded.error()));
      } else if (!std::cmp_equal(decoded->size(), count) || !spans(*decoded, start, end)) {
        report_.add_fault(which + ": holds other " + items + " than its row states");
      }
    }
    return after;
  }

  template <class Items>
  static bool spans(const Items& items, std::int64_t start_utime_us, std::int64_t end_utime_us) {
    const auto earlier = [](const auto& a, const auto& b) { return a.utime_us < b.utime_us; };
    const auto [first, last] = std::minmax_element(items.begin(), items.end(), earlier);
    return first != items.end() && first->utime_us == start_utime_us && last->utime_us == end_utime_us;
  }

  Database& database_;
  ContentReport report_;
};

}  // namespace

Result<std::vector<TableSummary>> summarize_tables(Database& database, const TableProgress& progress) {
  return guarded([&]() -> Result<std::vector<TableSummary>> {
    std::vector<TableSummary> all;
    for (const Table* table : copied_tables()) all.push_back(summarize(database, *table, progress));
    return all;
  });
}

Result<CopyReport> copy_tables(Database& from, Database& to, const TableProgress& progress) {
  return guarded([&]() -> Result<CopyReport> {
    CopyReport report;
    for (const Table* table : copied_tables()) {
      TRY_ASSIGN(const auto found, copy_table(from, to, *table, progress));
      report.rows_found += found;
    }
    copy_active_versions(from, to);
    {
      Transaction transaction(to, Database::Access::write);
      add_up_all_days(to);
      transaction.commit();
    }
    for (const Table* table : copied_tables()) {
      const TableSummary before = summarize(from, *table, progress);
      report.tables.push_back(summarize(to, *table, progress));
      if (report.tables.back() != before)
        return fail(Fault::corrupt, "to", "table " + before.table + " reads back differently");
    }
    return report;
  });
}

Result<VerifyReport> verify_tables(Database& database, const TableProgress& progress) {
  return guarded([&]() -> Result<VerifyReport> {
    TRY_ASSIGN(auto tables, summarize_tables(database, progress));
    return VerifyReport{check_content(database), std::move(tables)};
  });
}

void ContentReport::add_fault(std::string text) {
  if (faults.size() < max_faults) faults.push_back(std::move(text));
  ++fault_count;
}

ContentReport check_content(Database& database) {
  return ContentCheck(database).run();
}

}  // namespace joulecast::history
