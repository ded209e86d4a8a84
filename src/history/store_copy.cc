#include "history/store_copy.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <span>
#include <variant>

#include "base/try.h"
#include "history/mission_days.h"
#include "history/sql_store.h"

namespace joulecast::history {
namespace {

struct CopiedTable {
  std::string_view name;
  std::vector<std::string> key;  // its columns
  std::int64_t batch_rows;       // read in one query and written in one transaction
  // In tables that are keyed by robot: the table that names the row's robot, and the column that refers to
  // it.
  std::string_view owner = {}, owner_key = {};
  // The time by which there may be partitions.
  std::string_view time = {};
};

const std::vector<CopiedTable>& all_tables() {
  static const std::vector<CopiedTable> tables = {
      {"robot", {"robot_id"}, 1000},
      {"model", {"robot_id", "version"}, 100},
      {"mission", {"mission_key"}, 500},
      {"trace", {"mission_key", "start_utime_us"}, 2000, "mission", "mission_key", "start_utime_us"},
      {"telemetry_chunk", {"chunk_key"}, 200, "mission", "mission_key", "stored_utime_us"},
      {"covariate_chunk", {"chunk_key"}, 200, "mission", "mission_key", "stored_utime_us"},
      {"event", {"event_id"}, 1000},
      {"energy_state", {"robot_id"}, 1000},
      {"learned", {"robot_id", "topic"}, 100},
      {"diagnosis", {"diagnosis_id"}, 50},
      {"diagnosis_report", {"diagnosis_id"}, 50, "diagnosis", "diagnosis_id"},
      {"proposal", {"proposal_id"}, 50},
      {"audit", {"audit_id"}, 1000},
      {"request_answer", {"actor", "idempotency_key"}, 100},
      {"floor_plan", {"map", "level"}, 10},
  };
  return tables;
}

using Key = std::vector<std::variant<std::int64_t, std::string>>;

// The key's columns first, then the others by name: the same in every database. The robot of a row that
// belongs to a mission or diagnosis is omitted: its owner's row contains it.
std::vector<std::string> columns_of(Database& database, const CopiedTable& table) {
  const auto all = database.prepare("SELECT * FROM " + std::string(table.name) + " LIMIT 0");
  Rows rows(*all);
  rows.next();
  std::vector<std::string> columns = table.key, others;
  for (int k = 0; k < rows.columns(); ++k) {
    std::string name = all->name(k);
    if (!table.owner.empty() && name == "robot_id") continue;
    if (std::find(columns.begin(), columns.end(), name) == columns.end()) others.push_back(std::move(name));
  }
  std::sort(others.begin(), others.end());
  columns.insert(columns.end(), std::make_move_iterator(others.begin()),
                 std::make_move_iterator(others.end()));
  return columns;
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::int64_t rows_of(Database& database, const CopiedTable& table) {
  return database.integer("SELECT count(*) FROM " + std::string(table.name));
}

// Visits the rows that the statement gives, and puts the last one's key into `last`; answers how many they
// were.
template <class Visit>
std::int64_t visit_rows(Rows& rows, Statement& select, const CopiedTable& table, Key& last, Visit visit) {
  std::int64_t count = 0;
  Key key;
  for (; rows.next(); ++count) {
    visit(select);
    key.clear();
    for (int k = 0; k < static_cast<int>(table.key.size()); ++k) {
      if (select.type(k) == Statement::Type::integer)
        key.emplace_back(select.integer(k));
      else
        key.emplace_back(std::string(select.bytes(k)));
    }
  }
  if (count > 0) last = key;
  return count;
}

// The same as scan() of traces where they are keyed by robot first: mission by mission.
template <class Visit>
std::int64_t scan_by_mission(Database& database, const CopiedTable& table,
                             const std::vector<std::string>& columns, Key& after, std::int64_t limit,
                             Visit visit) {
  Statement& select =
      database.statement("SELECT " + joined(columns) + " FROM " + std::string(table.name) +
                         " WHERE robot_id = ? AND mission_key = ? AND start_utime_us > ? ORDER BY "
                         "start_utime_us LIMIT ?");
  std::int64_t mission = after.empty() ? 0 : std::get<std::int64_t>(after[0]);
  std::int64_t start = after.empty() ? whole_past : std::get<std::int64_t>(after[1]);
  for (;;) {
    std::string robot_id;
    std::int64_t key = 0;
    {
      Rows next(database.statement(
          "SELECT robot_id, mission_key FROM mission WHERE mission_key >= ? ORDER BY mission_key LIMIT 1"));
      if (!next.bind(mission).next()) return 0;
      robot_id = next.text();
      key = next.integer();
    }
    if (key != mission) start = whole_past;
    Rows rows(select);
    rows.bind(robot_id).bind(key).bind(start).bind(limit);
    if (const std::int64_t count = visit_rows(rows, select, table, after, visit); count > 0) return count;
    mission = key + 1;
    start = whole_past;
  }
}

// Visits the next rows by key, at most `limit`, and moves the key on; answers how many they were, 0 at the
// end.
template <class Visit>
std::int64_t scan(Database& database, const CopiedTable& table, const std::vector<std::string>& columns,
                  Key& after, std::int64_t limit, Visit visit) {
  if (table.key.front() == "mission_key" && !table.owner.empty() && database.keyed_by_robot())
    return scan_by_mission(database, table, columns, after, limit, visit);
  const std::string key = joined(table.key);
  const std::string beyond = " WHERE (" + key + ") > (" + placeholders(key) + ")";
  Statement& select = database.statement("SELECT " + joined(columns) + " FROM " + std::string(table.name) +
                                         (after.empty() ? "" : beyond) + " ORDER BY " + key + " LIMIT ?");
  Rows rows(select);
  for (const auto& part : after) std::visit([&](const auto& value) { rows.bind(value); }, part);
  rows.bind(limit);
  return visit_rows(rows, select, table, after, visit);
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
      for (const char c : bytes) mix(static_cast<unsigned char>(c), 1);
      sum_.value_bytes += static_cast<std::int64_t>(bytes.size());
      return;
    }
    if (type != Statement::Type::null) sum_.value_bytes += 8;
  }
  void mix(std::uint64_t value, unsigned bytes) {
    for (unsigned k = 0; k < bytes; ++k) hash_ = (hash_ ^ ((value >> (8 * k)) & 0xff)) * 0x100000001b3;
  }

  TableSummary sum_;
  std::uint64_t hash_ = 0xcbf29ce484222325;
};

int index_of(const std::vector<std::string>& columns, std::string_view name) {
  const auto found = std::find(columns.begin(), columns.end(), name);
  return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
}

// Of the first `rows` rows; `after` becomes the last one's key.
TableSummary summarize(Database& database, const CopiedTable& table, std::int64_t rows, int skipped_column,
                       Key& after, const TableProgress& progress) {
  const std::vector<std::string> columns = columns_of(database, table);
  Summary summary(table.name);
  std::int64_t done = 0;
  while (done < rows) {
    const std::int64_t limit = std::min(table.batch_rows, rows - done);
    const std::int64_t got = scan(database, table, columns, after, limit,
                                  [&](const Statement& row) { summary.add(row, skipped_column); });
    if (got == 0) break;
    done += got;
    progress(table.name, done, rows);
  }
  return summary.get();
}

TableSummary summarize(Database& database, const CopiedTable& table, const TableProgress& progress) {
  Key after;
  return summarize(database, table, rows_of(database, table), -1, after, progress);
}

void bind_column(Rows& to, const Statement& from, int column) {
  switch (from.type(column)) {
    case Statement::Type::null:
      to.bind_null();
      return;
    case Statement::Type::integer:
      to.bind(from.integer(column));
      return;
    case Statement::Type::real:
      to.bind(from.real(column));
      return;
    case Statement::Type::text:
      to.bind(from.bytes(column));
      return;
    case Statement::Type::blob:
      to.bind(std::as_bytes(std::span(from.bytes(column))));
      return;
  }
}

std::string insert_into(const Database& to, const CopiedTable& table,
                        const std::vector<std::string>& columns) {
  const bool owned = to.keyed_by_robot() && !table.owner.empty();
  std::string values;
  for (std::size_t k = 1; k <= columns.size(); ++k) values += (k > 1 ? ", ?" : "?") + std::to_string(k);
  const std::string owner_key(table.owner_key);
  const std::string robot = owned ? "(SELECT robot_id FROM " + std::string(table.owner) + " WHERE " +
                                        owner_key + " = ?" +
                                        std::to_string(index_of(columns, owner_key) + 1) + "), "
                                  : "";
  return "INSERT INTO " + std::string(table.name) + " (" + (owned ? "robot_id, " : "") + joined(columns) +
         ") VALUES (" + robot + values + ")";
}

// Robots before their models: which one is active comes when both are there. Answers the rows found.
Result<std::int64_t> copy_table(Database& from, Database& to, const CopiedTable& table,
                                const TableProgress& progress) {
  const std::vector<std::string> columns = columns_of(from, table);
  if (columns != columns_of(to, table))
    return fail(Fault::conflict, "to", "table " + std::string(table.name) + " has other columns");
  const int later = table.name == "robot" ? index_of(columns, "active_version") : -1;
  const std::int64_t rows = rows_of(from, table), found = rows_of(to, table);
  const auto quietly = [](std::string_view, std::int64_t, std::int64_t) {};
  Key after, same;
  if (found > rows || summarize(from, table, found, later, after, quietly) !=
                          summarize(to, table, found, later, same, quietly))
    return fail(
        Fault::conflict, "to",
        "table " + std::string(table.name) + " holds rows that are not the beginning of the copied table");
  const std::string insert = insert_into(to, table, columns);
  if (!table.time.empty() && rows > found) {
    const std::string time(table.time), of = " FROM " + std::string(table.name);
    to.expect_rows(table.name, from.integer("SELECT min(" + time + ")" + of),
                   from.integer("SELECT max(" + time + ")" + of));
  }
  for (std::int64_t done = found; done < rows;) {
    Transaction transaction(to, Database::Access::write);
    const std::int64_t got = scan(from, table, columns, after, table.batch_rows, [&](const Statement& row) {
      Rows target(to.statement(insert));
      for (int k = 0; k < row.columns(); ++k) {
        if (k == later) {
          target.bind_null();
        } else {
          bind_column(target, row, k);
        }
      }
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
    Rows(to.statement("UPDATE robot SET active_version = ? WHERE robot_id = ?"))
        .bind(rows.optional_integer())
        .bind(robot_id)
        .run_later();
  }
  transaction.commit();
}

}  // namespace

std::vector<std::string> table_names() {
  std::vector<std::string> names;
  for (const CopiedTable& table : all_tables()) names.emplace_back(table.name);
  return names;
}

Result<std::vector<TableSummary>> summarize_tables(Database& database, const TableProgress& progress) {
  return guarded([&]() -> Result<std::vector<TableSummary>> {
    std::vector<TableSummary> all;
    for (const CopiedTable& table : all_tables()) all.push_back(summarize(database, table, progress));
    return all;
  });
}

Result<CopyReport> copy_tables(Database& from, Database& to, const TableProgress& progress) {
  return guarded([&]() -> Result<CopyReport> {
    CopyReport report;
    for (const CopiedTable& table : all_tables()) {
      TRY_ASSIGN(const auto found, copy_table(from, to, table, progress));
      report.rows_found += found;
    }
    copy_active_versions(from, to);
    if (to.keyed_by_robot()) {
      Transaction transaction(to, Database::Access::write);
      add_up_all_days(to);
      transaction.commit();
    }
    for (const CopiedTable& table : all_tables()) {
      const TableSummary before = summarize(from, table, progress);
      report.tables.push_back(summarize(to, table, progress));
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

}  // namespace joulecast::history
