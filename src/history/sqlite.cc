#include "history/sqlite.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <utility>

#include "base/try.h"

namespace joulecast::history {
namespace {

SqlError::Kind kind_of(int code) {
  using enum SqlError::Kind;
  static constexpr std::pair<int, SqlError::Kind> kinds[] = {
      {SQLITE_CONSTRAINT, values},    {SQLITE_TOOBIG, values},        {SQLITE_MISMATCH, values},
      {SQLITE_CORRUPT, corrupt},      {SQLITE_NOTADB, corrupt},       {SQLITE_FULL, unavailable},
      {SQLITE_IOERR, unavailable},    {SQLITE_BUSY, unavailable},     {SQLITE_LOCKED, unavailable},
      {SQLITE_CANTOPEN, unavailable}, {SQLITE_READONLY, unavailable}, {SQLITE_PERM, unavailable},
      {SQLITE_AUTH, unavailable},     {SQLITE_NOMEM, unavailable},    {SQLITE_INTERRUPT, unavailable},
      {SQLITE_PROTOCOL, unavailable}};
  for (const auto& [each, kind] : kinds)
    if (each == (code & 0xff)) return kind;
  return internal;
}

[[noreturn]] void raise_error(sqlite3* database, int code, std::string message = {}) {
  message += database ? sqlite3_errmsg(database) : sqlite3_errstr(code);
  throw SqlError(kind_of(code), message);
}

class SqliteStatement final : public Statement {
 public:
  SqliteStatement(sqlite3* database, std::string_view sql) {
    const int code = sqlite3_prepare_v3(database, sql.data(), static_cast<int>(sql.size()),
                                        SQLITE_PREPARE_PERSISTENT, &handle_, nullptr);
    if (code != SQLITE_OK) raise_error(database, code, "cannot prepare a statement: ");
  }
  ~SqliteStatement() override { sqlite3_finalize(handle_); }

  void bind_null(int parameter) override { check(sqlite3_bind_null(handle_, parameter + 1)); }
  void bind(int parameter, std::int64_t value) override {
    check(sqlite3_bind_int64(handle_, parameter + 1, value));
  }
  void bind(int parameter, double value) override {
    check(sqlite3_bind_double(handle_, parameter + 1, value));
  }
  void bind(int parameter, std::string_view value) override {
    // A null pointer would bind NULL instead of the empty text.
    const char* data = value.data() ? value.data() : "";
    check(sqlite3_bind_text64(handle_, parameter + 1, data, value.size(), SQLITE_STATIC, SQLITE_UTF8));
  }
  void bind(int parameter, std::span<const std::byte> value) override {
    check(sqlite3_bind_blob64(handle_, parameter + 1, value.data(), value.size(), SQLITE_STATIC));
  }

  bool step() override {
    const int code = sqlite3_step(handle_);
    if (code == SQLITE_ROW) return true;
    if (code != SQLITE_DONE) raise_error(sqlite3_db_handle(handle_), code);
    return false;
  }
  void step_later() override {
    while (step()) {
    }
  }
  std::int64_t changed() const override { return sqlite3_changes64(sqlite3_db_handle(handle_)); }
  void reset() override {
    sqlite3_reset(handle_);
    sqlite3_clear_bindings(handle_);
  }

  int columns() const override { return sqlite3_column_count(handle_); }
  Type type(int column) const override {
    const int type = sqlite3_column_type(handle_, column);
    if (type == SQLITE_INTEGER) return Type::integer;
    if (type == SQLITE_FLOAT) return Type::real;
    if (type == SQLITE_TEXT) return Type::text;
    return type == SQLITE_BLOB ? Type::blob : Type::null;
  }
  std::int64_t integer(int column) const override { return sqlite3_column_int64(handle_, column); }
  double real(int column) const override { return sqlite3_column_double(handle_, column); }
  std::string_view bytes(int column) const override {
    const auto* data = static_cast<const char*>(sqlite3_column_blob(handle_, column));
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(handle_, column));
    return {data, data ? size : 0};
  }

 private:
  void check(int code) const {
    if (code != SQLITE_OK) raise_error(sqlite3_db_handle(handle_), code);
  }

  sqlite3_stmt* handle_ = nullptr;
};

// ", process 123", which the file contains; empty without it.
std::string holder_of(int descriptor) {
  std::array<char, 16> text{};
  int process = 0;
  if (const auto size = pread(descriptor, text.data(), text.size(), 0); size > 0)
    std::from_chars(text.data(), text.data() + size, process);
  return process > 0 ? " (process " + std::to_string(process) + ")" : "";
}

}  // namespace

SqliteDatabase::SqliteDatabase(const std::string& path, OpenMode mode, std::int64_t busy_timeout_ms) {
  const int flags =
      SQLITE_OPEN_NOMUTEX |
      (mode == OpenMode::read_only ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  const int code = sqlite3_open_v2(path.c_str(), &handle_, flags, nullptr);
  if (code != SQLITE_OK) {
    const std::string message =
        "cannot open the database: " + std::string(handle_ ? sqlite3_errmsg(handle_) : sqlite3_errstr(code));
    sqlite3_close_v2(std::exchange(handle_, nullptr));
    throw SqlError(kind_of(code), message);
  }
  sqlite3_extended_result_codes(handle_, 1);
  sqlite3_busy_timeout(handle_, static_cast<int>(busy_timeout_ms));
}

SqliteDatabase::~SqliteDatabase() {
  forget_statements();
  sqlite3_close_v2(handle_);
}

void SqliteDatabase::execute(const std::string& sql) {
  const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) raise_error(handle_, code);
}

std::unique_ptr<Statement> SqliteDatabase::prepare(std::string_view sql) {
  return std::make_unique<SqliteStatement>(handle_, sql);
}

bool SqliteDatabase::has_table(std::string_view name) {
  Rows rows(statement("SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?"));
  return rows.bind(name).next();
}

bool SqliteDatabase::in_transaction() const {
  return sqlite3_get_autocommit(handle_) == 0;
}

void SqliteDatabase::begin(Access access) {
  Rows(statement(access == Access::write ? "BEGIN IMMEDIATE" : "BEGIN")).run();
}

FileLock::~FileLock() {
  close(descriptor_);
}

Result<std::unique_ptr<FileLock>> FileLock::acquire(const std::string& path, bool names_holder) {
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor < 0)
    return fail(Fault::unavailable, "database", "cannot open " + path + ": " + std::strerror(errno));
  auto lock = std::make_unique<FileLock>(descriptor);
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    const std::string holder = names_holder ? holder_of(descriptor) : "";
    return fail(Fault::conflict, "database",
                path + " is locked: another joulecast program" + holder + " has this store open");
  }
  if (names_holder && ftruncate(descriptor, 0) == 0) {
    const std::string own = std::to_string(getpid());
    [[maybe_unused]] const auto written = write(descriptor, own.data(), own.size());
  }
  return lock;
}

Result<std::vector<std::unique_ptr<FileLock>>> lock_store(const std::string& path) {
  std::vector<std::unique_ptr<FileLock>> locks;
  for (const char* suffix : {".lock", ""}) {
    TRY_ASSIGN(auto lock, FileLock::acquire(path + suffix, *suffix != '\0'));
    locks.push_back(std::move(lock));
  }
  return locks;
}

}  // namespace joulecast::history
