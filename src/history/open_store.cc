#include "history/open_store.h"

#include <filesystem>
#include <regex>
#include <utility>

#include "history/postgres.h"
#include "history/postgres_store.h"
#include "history/schema.h"
#include "history/sql_store.h"
#include "history/sqlite.h"
#include "history/sqlite_store.h"

namespace joulecast::history {
namespace {

constexpr std::string_view sqlite_scheme = "sqlite:";

PostgresOptions postgres_options(const std::string& url) {
  PostgresOptions options;
  options.url = url;
  return options;
}

SqliteOptions sqlite_options(const std::string& url) {
  SqliteOptions options;
  options.path = sqlite_path(url);
  return options;
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
  static const std::regex of_user("(://[^/@:]*):[^/@]*@"), as_option("([?&]password=)[^&]*");
  return std::regex_replace(std::regex_replace(url, of_user, "$1@"), as_option, "$1...");
}

std::string sqlite_path(const std::string& url) {
  return url.starts_with(sqlite_scheme) ? url.substr(sqlite_scheme.size()) : url;
}

Result<std::unique_ptr<Store>> open_store(const std::string& url, const StandbyOptions& standby) {
  if (auto ok = check_store_url(url); !ok) return tl::unexpected(ok.error());
  if (is_postgres_url(url)) {
    PostgresOptions options = postgres_options(url);
    options.standby = standby;
    return open_postgres_store(options);
  }
  if (!standby.url.empty()) return invalid("standby", "only a PostgreSQL has standbys");
  return open_sqlite_store(sqlite_options(url));
}

Result<std::unique_ptr<Store>> open_shared_store(
    const std::string& url, const std::string& writer,
    std::function<void(const std::string&, Epoch, std::uint64_t)> on_dropped, const StandbyOptions& standby) {
  if (!is_postgres_url(url)) return invalid("url", "must be postgresql://...");
  PostgresOptions options = postgres_options(url);
  options.shared_writer = writer;
  options.on_dropped = std::move(on_dropped);
  options.standby = standby;
  return open_postgres_store(options);
}

Result<std::shared_ptr<Database>> open_tables(const std::string& url, bool must_exist) {
  if (auto ok = check_store_url(url); !ok) return tl::unexpected(ok.error());
  if (must_exist)
    if (const auto there = open_to_read(url); !there) return tl::unexpected(there.error());
  if (is_postgres_url(url)) return open_postgres_tables(postgres_options(url));
  return open_sqlite_tables(sqlite_options(url));
}

Result<std::unique_ptr<Database>> open_to_read(const std::string& url) {
  if (auto ok = check_store_url(url); !ok) return tl::unexpected(ok.error());
  return guarded([&]() -> Result<std::unique_ptr<Database>> {
    std::unique_ptr<Database> database;
    bool is_store = false;
    if (is_postgres_url(url)) {
      database = std::make_unique<PostgresDatabase>(url, "joulecast-reader");
      is_store = database->has_table("joulecast_store");
    } else {
      const SqliteOptions options = sqlite_options(url);
      if (!std::filesystem::exists(options.path))
        return fail(Fault::not_found, "url", "there is no file " + options.path);
      database = std::make_unique<SqliteDatabase>(options.path, OpenMode::read_only, options.busy_timeout_ms);
      is_store = database->integer("PRAGMA application_id") == store_application_id;
    }
    if (!is_store) return fail(Fault::corrupt, "url", "is not a joulecast store");
    return database;
  });
}

}  // namespace joulecast::history
