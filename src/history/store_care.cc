#include "history/store_care.h"

#include <sys/stat.h>
#include <unistd.h>

#include <boost/algorithm/string/replace.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "base/host_clock.h"
#include "base/text_file.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "history/open_store.h"
#include "history/schema.h"
#include "history/sql_store.h"
#include "history/sqlite.h"

namespace joulecast::history {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t care_busy_timeout_ms = 10'000;
constexpr int most_failures = 10'000;  // of reads of one table

void add_texts(StoreCheck& check, Database& database, const std::string& sql) {
  Rows rows(database, sql);
  while (rows.next()) check.add_fault(rows.text());
}

std::string quoted(const std::string& text) {
  return "'" + boost::replace_all_copy(text, "'", "''") + "'";
}

Result<OutputFile> new_file(const std::string& path) {
  if (!may_write(path, path, Existing::refuse)) return fail(Fault::conflict, path, "already exists");
  return OutputFile::create(path, Existing::refuse);
}

// A compact copy, for which SQLite wants a connection that might write; it gives free pages back from now on.
Result<void> copy_into(Database& from, const std::string& file) {
  return guarded(
      [&]() -> Result<void> {
        from.execute("PRAGMA auto_vacuum = INCREMENTAL");
        from.execute("VACUUM INTO " + quoted(file));
        return {};
      },
      file);
}

// A range of keys that could not be read.
struct LostKeys {
  std::int64_t from, to;
  std::string why;
};

// The columns that a table has in both files, as a list; empty where the damaged one has no such table.
std::string common_columns(Database& database, const std::string& table) {
  Rows rows(database,
            "SELECT coalesce(group_concat('\"' || name || '\"'), '') FROM pragma_table_info(?1, 'main') "
            "WHERE name IN (SELECT name FROM pragma_table_info(?1, 'damaged')) AND EXISTS (SELECT 1 FROM "
            "damaged.sqlite_schema WHERE type = 'table' AND name = ?1)",
            table);
  return rows.next() ? rows.text() : std::string();
}

// Copies the rows of keys from..to; if they cannot be read, those of either half, down to single keys.
void salvage_range(Database& database, const std::string& table, const std::string& columns,
                   const std::string& key, std::int64_t from, std::int64_t to, int& failures,
                   std::vector<LostKeys>& lost) {
  try {
    Rows(database,
         "INSERT OR IGNORE INTO main." + table + " (" + columns + ") SELECT " + columns + " FROM damaged." +
             table + " WHERE " + key + " BETWEEN ? AND ?",
         from, to)
        .run();
  } catch (const SqlError& error) {
    if (error.fault() != Fault::corrupt) throw;
    if (from == to || ++failures > most_failures) {
      if (!lost.empty() && lost.back().to + 1 == from)
        lost.back().to = to;
      else
        lost.push_back({from, to, error.what()});
      return;
    }
    const std::int64_t middle = from + (to - from) / 2;
    salvage_range(database, table, columns, key, from, middle, failures, lost);
    salvage_range(database, table, columns, key, middle + 1, to, failures, lost);
  }
}

std::int64_t greatest(Database& database, const std::string& table, const std::string& key) {
  try {
    return database.integer("SELECT coalesce(max(" + key + "), 0) FROM damaged." + table);
  } catch (const SqlError&) {
    return std::int64_t{1} << 24;  // the path to the last row is damaged
  }
}

// A damaged page that reads as empty hides its rows without an error.
void report_damage(Database& database, Salvage& salvage) {
  const auto add = [&](const std::string& what) {
    if (what != "ok")
      salvage.losses.push_back("the damaged file, in which unreferenced rows may be missing: " + what);
  };
  try {
    Rows damage(database, "PRAGMA damaged.integrity_check(3)");
    while (damage.next()) add(damage.text());
  } catch (const SqlError& error) {
    add(error.what());
  }
}

// Deletes rows that refer to an unreadable row, and reports their number.
void drop(Database& database, const std::string& table, const std::string& of, const std::string& condition,
          Salvage& salvage) {
  const std::int64_t dropped = Rows(database, "DELETE FROM " + table + " WHERE " + condition).run();
  if (dropped > 0)
    salvage.losses.push_back(table + ": " + std::to_string(dropped) + " readable rows; their " + of +
                             " could not be read");
}

void drop_loose_ends(Database& database, Salvage& salvage) {
  for (const char* table : {"model", "mission", "energy_state", "learned", "diagnosis", "proposal"})
    database.execute(
        "INSERT OR IGNORE INTO robot (robot_id, created_utime_us) SELECT DISTINCT robot_id, 0 FROM " +
        std::string(table));
  const std::string trigger =
      database.text("SELECT sql FROM sqlite_schema WHERE name = 'model_is_immutable'");
  database.execute("DROP TRIGGER model_is_immutable");
  const auto clear = [&](const std::string& table, const std::string& column, const std::string& instead) {
    database.execute("UPDATE " + table + " SET " + column + " = " + instead + " WHERE " + column +
                     " IS NOT NULL AND NOT EXISTS (SELECT 1 FROM model AS m WHERE m.robot_id = " + table +
                     ".robot_id AND m.version = " + table + "." + column + ")");
  };
  clear("robot", "active_version", "(SELECT max(version) FROM model AS m WHERE m.robot_id = robot.robot_id)");
  clear("model", "parent_version", "NULL");
  clear("mission", "model_version", "NULL");
  clear("diagnosis", "model_version", "NULL");
  clear("proposal", "base_version", "NULL");
  clear("proposal", "adopted_version", "NULL");
  database.execute(trigger);
  for (const char* table : {"trace", "telemetry_chunk", "covariate_chunk"})
    drop(database, table, "missions", "mission_key NOT IN (SELECT mission_key FROM mission)", salvage);
  drop(database, "diagnosis_report", "diagnoses", "diagnosis_id NOT IN (SELECT diagnosis_id FROM diagnosis)",
       salvage);
}

// A file that root creates is given to the owner of `example`: the file before it or its directory.
Result<void> give_to_owner(const std::string& file, const fs::path& example) {
  struct stat owner {};
  if (geteuid() != 0) return {};
  if (stat(example.c_str(), &owner) != 0 || chown(file.c_str(), owner.st_uid, owner.st_gid) != 0)
    return fail(Fault::unavailable, file,
                std::string("cannot be given to its owner: ") + std::strerror(errno));
  return {};
}

}  // namespace

Result<StoreCheck> check_store(const std::string& path) {
  TRY_ASSIGN(auto database, open_file(path));
  return guarded(
      [&]() -> Result<StoreCheck> {
        StoreCheck check = check_content(*database);
        for (std::string& difference : schema_differences(*database, store_schema()))
          check.add_fault(std::move(difference));
        try {
          add_texts(check, *database,
                    "SELECT integrity_check FROM pragma_integrity_check(100) WHERE integrity_check <> 'ok'");
          add_texts(check, *database,
                    "SELECT \"table\" || ', row ' || coalesce(rowid, 0) || ': refers to nothing in ' || "
                    "parent FROM pragma_foreign_key_check");
        } catch (const SqlError& error) {
          check.add_fault(error.what());
        }
        return check;
      },
      path);
}

Result<StoreCheck> back_up_store(const std::string& path, const std::string& copy) {
  TRY_ASSIGN(auto file, new_file(copy));
  TRY_ASSIGN(auto database, open_file(path, OpenMode::read_write_create));
  // A damaged store may fail to be copied with another error, such as a full disk.
  const Result<void> copied = copy_into(*database, file.written_to());
  auto check = check_store(copied ? file.written_to() : path);
  if (check && !check->faults.empty())
    return fail(Fault::corrupt, path, "is damaged: " + check->faults.front());
  TRY(copied);
  TRY(check);
  TRY(file.commit());
  return check;
}

Result<std::string> restore_store(const std::string& from, const std::string& path) {
  std::error_code unknown;
  if (fs::equivalent(from, path, unknown)) return invalid(from, "is the store itself");
  const bool replaces = fs::exists(path);
  TRY_ASSIGN(auto locks, lock_store(path));
  if (!replaces) fs::remove(path, unknown);  // the lock has made an empty one
  TRY_ASSIGN(auto file, OutputFile::create(path, Existing::replace));
  {
    TRY_ASSIGN(auto check, check_store(from));
    if (!check.faults.empty()) return fail(Fault::corrupt, from, "is damaged: " + check.faults.front());
    TRY_ASSIGN(auto source, open_file(from, OpenMode::read_write_create));
    TRY(copy_into(*source, file.written_to()));
  }
  TRY(give_to_owner(file.written_to(), replaces ? fs::path(path) : fs::absolute(path).parent_path()));
  std::string before;
  if (replaces) {
    before = path + ".before-" + format_utc(host_utime_us(), "%Y%m%dT%H%M%S");
    for (const char* suffix : {"", "-wal", "-shm", ".spool"}) {
      fs::rename(path + suffix, before + suffix, unknown);
      if (unknown && fs::exists(path + suffix))
        return fail(Fault::unavailable, path + suffix, "cannot be put aside: " + unknown.message());
    }
  }
  TRY(file.commit());
  return before;
}

Result<Salvage> salvage_store(const std::string& damaged, const std::string& into) {
  TRY(open_file(damaged, OpenMode::read_only, true));
  auto file = new_file(into);
  if (!file) return tl::unexpected(file.error());
  Salvage salvage;
  auto done = guarded(
      [&]() -> Result<void> {
        SqliteDatabase database(file->written_to(), OpenMode::read_write_create, care_busy_timeout_ms);
        database.execute("PRAGMA auto_vacuum = INCREMENTAL");
        TRY(bring_to_schema(database, store_schema()));
        database.execute("PRAGMA synchronous = OFF");
        database.execute("ATTACH " + quoted(damaged) + " AS damaged");
        for (const auto& [table, all, keys] : store_tables()) {
          if (table == "joulecast_store") continue;
          const std::string key = table == "trace" ? keys.front() : "rowid";
          // A table that the file has not, or not as a table, has no rows.
          const std::string columns = common_columns(database, table);
          if (columns.empty()) continue;
          int failures = 0;
          std::vector<LostKeys> lost;
          salvage_range(database, table, columns, key, 0, greatest(database, table, key), failures, lost);
          for (const auto& [from, to, why] : lost)
            if (salvage.losses.size() < max_faults)
              salvage.losses.push_back(table + ", its rows with " + key + " " + std::to_string(from) +
                                       (from == to ? "" : " to " + std::to_string(to)) + ": " + why);
        }
        drop_loose_ends(database, salvage);
        report_damage(database, salvage);
        for (const Table& table : store_tables())
          if (table.name != "joulecast_store")
            salvage.rows += database.integer("SELECT count(*) FROM main." + table.name);
        return {};
      },
      damaged);
  if (!done) return tl::unexpected(done.error());
  TRY(file->commit());
  return salvage;
}

}  // namespace joulecast::history
