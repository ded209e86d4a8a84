#include "history/open_store.h"

#include <re2/re2.h>

#include <filesystem>
#include <utility>

#include "base/try.h"
#include "history/postgres.h"
#include "history/schema.h"
#include "history/sql_store.h"

namespace joulecast::history {
namespace {

constexpr std::string_view sqlite_scheme = "sqlite:";

constexpr std::int64_t offline_busy_timeout_ms = 10'000;

Result<std::unique_ptr<SqliteDatabase>> connect_file(const std::string& path, OpenMode mode) {
  if (!std::filesystem::is_regular_file(path)) return fail(Fault::not_found, path, "does not exist");
  auto open = [&]() -> Result<std::unique_ptr<SqliteDatabase>> {
    auto database = std::make_unique<SqliteDatabase>(path, mode, offline_busy_timeout_ms);
    if (database->integer("PRAGMA application_id") != store_application_id)
      return fail(Fault::corrupt, path, "is not a joulecast store");
    return database;
  };
  return guarded(open, path);
}

Result<std::unique_ptr<PostgresDatabase>> connect_server(const std::string& url) {
  return guarded([&]() -> Result<std::unique_ptr<PostgresDatabase>> {
    auto database = std::make_unique<PostgresDatabase>(url, "joulecast-reader");
    if (!database->has_table("joulecast_store"))
      return fail(Fault::corrupt, "url", "is not a joulecast store");
    return database;
  });
}

Result<void> check_version(const std::string& where, std::int64_t version, const Schema& schema) {
  const std::int64_t own = schema.version;
  if (version == own) return {};
  if (version < own)
    if (auto known = check_older(schema, version); !known)
      return fail(Fault::conflict, where, known.error().message);
  return fail(Fault::conflict, where,
              "has schema version " + std::to_string(version) + "; this program's is " + std::to_string(own) +
                  (version < own ? ", to which a start of the daemon brings it" : ""));
}

}  // namespace

bool is_postgres_url(std::string_view url) {
  return url.starts_with("postgresql://") || url.starts_with("postgres://");
}

Result<void> check_store_url(const std::string& url) {
  if (url.empty()) return invalid("url", "must not be empty");
  if (is_postgres_url(url)) return check_postgres_url(url);
  if (url.starts_with(sqlite_scheme) || url.find("://") == std::string_view::npos) return {};
  return invalid("url", "must be sqlite:PATH or postgresql://...");
}

std::string shown_url(const std::string& url) {
  if (!is_postgres_url(url)) return url;
  static const RE2 of_user("(://[^/@:]*):[^/@]*@"), as_option("([?&]password=)[^&]*");
  std::string shown = url;
  RE2::GlobalReplace(&shown, of_user, "\\1@");
  RE2::GlobalReplace(&shown, as_option, "\\1...");
  return shown;
}

std::string sqlite_path(const std::string& url) {
  return url.starts_with(sqlite_scheme) ? url.substr(sqlite_scheme.size()) : url;
}

Result<std::unique_ptr<Store>> open_store(const std::string& url, const StoreOptions& options) {
  TRY(check_store_url(url));
  if (is_postgres_url(url)) return open_postgres_store(url, options);
  if (!options.shared_writer.empty()) return invalid("url", "must be postgresql://...");
  return open_sqlite_store(sqlite_path(url), options);
}

Result<std::shared_ptr<Database>> open_tables(const std::string& url, bool must_exist) {
  TRY(check_store_url(url));
  if (is_postgres_url(url)) {
    if (must_exist) TRY(connect_server(url));
    return open_postgres_tables(url, {});
  }
  if (must_exist)
    if (const auto there = connect_file(sqlite_path(url), OpenMode::read_only); !there)
      return fail(there.error().fault, "url", describe(there.error()));
  return open_sqlite_tables(sqlite_path(url), {});
}

Result<std::unique_ptr<SqliteDatabase>> open_file(const std::string& path, OpenMode mode, bool or_older) {
  TRY_ASSIGN(auto database, connect_file(path, mode));
  TRY_ASSIGN(
      const auto version,
      guarded([&]() -> Result<std::int64_t> { return database->integer("PRAGMA user_version"); }, path));
  if (or_older && version < store_schema().version) return database;
  TRY(check_version(path, version, store_schema()));
  return database;
}

Result<std::unique_ptr<Database>> open_to_read(const std::string& url) {
  TRY(check_store_url(url));
  if (!is_postgres_url(url)) return open_file(sqlite_path(url));
  TRY_ASSIGN(auto database, connect_server(url));
  TRY_ASSIGN(const auto version, guarded([&]() -> Result<std::int64_t> {
               return database->integer("SELECT schema_version FROM joulecast_store");
             }));
  TRY(check_version("url", version, postgres_schema()));
  return std::unique_ptr<Database>(std::move(database));
}

}  // namespace joulecast::history
