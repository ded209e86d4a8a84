#include "history/sqlite.h"

#include <sqlite3.h>

#include <cmath>
#include <utility>

namespace joulecast::history {
namespace {

[[noreturn]] void raise_error(sqlite3* database, int code, std::string_view doing) {
  std::string message(doing);
  message += ": ";
  message += database ? sqlite3_errmsg(database) : sqlite3_errstr(code);
  const int extended = database ? sqlite3_extended_errcode(database) : code;
  throw SqliteError((extended & 0xff) == (code & 0xff) ? extended : code, message);
}

}  // namespace

Fault SqliteError::fault() const {
  switch (code_ & 0xff) {
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return Fault::corrupt;
    case SQLITE_FULL:
    case SQLITE_IOERR:
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_AUTH:
    case SQLITE_NOMEM:
    case SQLITE_INTERRUPT:
    case SQLITE_PROTOCOL:
      return Fault::unavailable;
    default:
      return Fault::internal;
  }
}

bool SqliteError::is_about_values() const {
  const int primary = code_ & 0xff;
  return primary == SQLITE_CONSTRAINT || primary == SQLITE_TOOBIG || primary == SQLITE_MISMATCH;
}

Statement::Statement(sqlite3* database, std::string_view sql) {
  const int code = sqlite3_prepare_v3(database, sql.data(), static_cast<int>(sql.size()),
                                      SQLITE_PREPARE_PERSISTENT, &handle_, nullptr);
  if (code != SQLITE_OK) raise_error(database, code, "cannot prepare a statement");
}

Statement::~Statement() {
  sqlite3_finalize(handle_);
}

Statement::Statement(Statement&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}

Rows::Rows(Statement& statement) : handle_(statement.handle_) {}

Rows::~Rows() {
  sqlite3_reset(handle_);
  sqlite3_clear_bindings(handle_);
}

void Rows::raise(int code) const {
  raise_error(sqlite3_db_handle(handle_), code, "database");
}

void Rows::check(int code) const {
  if (code != SQLITE_OK) raise(code);
}

Rows& Rows::bind(std::int64_t value) {
  check(sqlite3_bind_int64(handle_, ++parameter_, value));
  return *this;
}

Rows& Rows::bind(bool value) {
  return bind(std::int64_t{value});
}

Rows& Rows::bind(double value) {
  if (std::isnan(value)) return bind_null();
  check(sqlite3_bind_double(handle_, ++parameter_, value));
  return *this;
}

Rows& Rows::bind(std::string_view value) {
  // A null pointer would bind NULL instead of the empty text.
  const char* data = value.data() ? value.data() : "";
  check(sqlite3_bind_text64(handle_, ++parameter_, data, value.size(), SQLITE_STATIC, SQLITE_UTF8));
  return *this;
}

Rows& Rows::bind(std::span<const std::byte> value) {
  check(sqlite3_bind_blob64(handle_, ++parameter_, value.data(), value.size(), SQLITE_STATIC));
  return *this;
}

Rows& Rows::bind_null() {
  check(sqlite3_bind_null(handle_, ++parameter_));
  return *this;
}

bool Rows::next() {
  column_ = 0;
  const int code = sqlite3_step(handle_);
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE) raise(code);
  return false;
}

std::int64_t Rows::run() {
  while (next()) {
  }
  return sqlite3_changes64(sqlite3_db_handle(handle_));
}

bool Rows::is_null() const {
  return sqlite3_column_type(handle_, column_) == SQLITE_NULL;
}

std::int64_t Rows::integer() {
  return sqlite3_column_int64(handle_, column_++);
}

double Rows::real() {
  const bool absent = is_null();
  const double value = sqlite3_column_double(handle_, column_++);
  return absent ? std::nan("") : value;
}

std::string Rows::text() {
  const auto* data = reinterpret_cast<const char*>(sqlite3_column_text(handle_, column_));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(handle_, column_));
  ++column_;
  return data ? std::string(data, size) : std::string();
}

std::span<const std::byte> Rows::blob() {
  const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(handle_, column_));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(handle_, column_));
  ++column_;
  return {data, data ? size : 0};
}

std::optional<std::int64_t> Rows::optional_integer() {
  const bool absent = is_null();
  const std::int64_t value = integer();
  return absent ? std::nullopt : std::optional(value);
}

Database::Database(const std::string& path, OpenMode mode, std::int64_t busy_timeout_ms) {
  const int flags =
      SQLITE_OPEN_NOMUTEX |
      (mode == OpenMode::read_only ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  const int code = sqlite3_open_v2(path.c_str(), &handle_, flags, nullptr);
  if (code != SQLITE_OK) {
    const std::string message =
        "cannot open the database: " + std::string(handle_ ? sqlite3_errmsg(handle_) : sqlite3_errstr(code));
    sqlite3_close_v2(std::exchange(handle_, nullptr));
    throw SqliteError(code, message);
  }
  sqlite3_extended_result_codes(handle_, 1);
  sqlite3_busy_timeout(handle_, static_cast<int>(busy_timeout_ms));
}

Database::~Database() {
  statements_.clear();
  sqlite3_close_v2(handle_);
}

void Database::execute(const std::string& sql) {
  const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) raise_error(handle_, code, "database");
}

Statement& Database::statement(std::string_view sql) {
  auto found = statements_.find(sql);
  if (found == statements_.end())
    found = statements_.emplace(std::string(sql), Statement(handle_, sql)).first;
  return found->second;
}

std::int64_t Database::integer(std::string_view sql) {
  Statement once(handle_, sql);
  Rows rows(once);
  return rows.next() ? rows.integer() : 0;
}

std::string Database::text(std::string_view sql) {
  Statement once(handle_, sql);
  Rows rows(once);
  return rows.next() ? rows.text() : std::string();
}

bool Database::in_transaction() const {
  return sqlite3_get_autocommit(handle_) == 0;
}

Transaction::Transaction(Database& database, Kind kind) : database_(database) {
  Rows(database_.statement(kind == Kind::write ? "BEGIN IMMEDIATE" : "BEGIN")).run();
}

Transaction::~Transaction() {
  // SQLite itself rolls back after some errors (full, I/O); then there is nothing left to end.
  if (!database_.in_transaction()) return;
  try {
    Rows(database_.statement("ROLLBACK")).run();
  } catch (const SqliteError&) {
    // The next BEGIN fails and is reported.
  }
}

void Transaction::commit() {
  Rows(database_.statement("COMMIT")).run();
}

}  // namespace joulecast::history
