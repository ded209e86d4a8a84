#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/error.h"

struct sqlite3;
struct sqlite3_stmt;

// SQLite in four types: Database, Statement, Rows (a statement being run) and Transaction. They throw
// SqliteError, which never leaves this room: the store turns it into an Error at its border.
namespace joulecast::history {

class SqliteError : public std::runtime_error {
 public:
  SqliteError(int code, const std::string& message) : std::runtime_error(message), code_(code) {}

  // corrupt, unavailable or internal, by the result code.
  Fault fault() const;
  // True when the values are at fault and not the database: a broken constraint, a value too big.
  bool is_about_values() const;

 private:
  int code_;
};

// A prepared statement. Runs through Rows, one at a time.
class Statement {
 public:
  Statement(sqlite3* database, std::string_view sql);
  ~Statement();
  Statement(Statement&& other) noexcept;
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  Statement& operator=(Statement&&) = delete;

 private:
  friend class Rows;
  sqlite3_stmt* handle_ = nullptr;
};

// One run of a statement: bind its parameters left to right, then step; read a row's columns left to right.
// Resets the statement at the end of its scope. Text and blobs bound must outlive it.
class Rows {
 public:
  explicit Rows(Statement& statement);
  ~Rows();
  Rows(const Rows&) = delete;
  Rows& operator=(const Rows&) = delete;

  Rows& bind(std::int64_t value);
  Rows& bind(bool value);
  Rows& bind(double value);  // NaN binds NULL
  Rows& bind(std::string_view value);
  Rows& bind(const char* value) { return bind(std::string_view(value)); }
  Rows& bind(const std::string& value) { return bind(std::string_view(value)); }
  Rows& bind(std::span<const std::byte> value);
  Rows& bind_null();
  template <class T>
  Rows& bind(const std::optional<T>& value) {
    return value ? bind(*value) : bind_null();
  }

  // Steps to the next row; false when there is none.
  bool next();
  // Steps a statement that gives no rows; answers the number of rows it changed.
  std::int64_t run();

  std::int64_t integer();
  bool boolean() { return integer() != 0; }
  double real();  // NULL reads NaN
  std::string text();
  std::span<const std::byte> blob();  // valid until the next step
  std::optional<std::int64_t> optional_integer();

 private:
  [[noreturn]] void raise(int code) const;
  void check(int code) const;
  bool is_null() const;

  sqlite3_stmt* handle_;
  int parameter_ = 0;
  int column_ = 0;
};

enum class OpenMode { read_write_create, read_only };

// One connection, used by one thread at a time.
class Database {
 public:
  Database(const std::string& path, OpenMode mode, std::int64_t busy_timeout_ms);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // Runs statements that give no rows worth reading.
  void execute(const std::string& sql);
  // The statement of that text, prepared once and kept.
  Statement& statement(std::string_view sql);
  // A statement that is not kept: for texts of which there are many.
  Statement prepare(std::string_view sql) { return {handle_, sql}; }
  // The first column of the first row of a query without parameters.
  std::int64_t integer(std::string_view sql);
  std::string text(std::string_view sql);

  bool in_transaction() const;

 private:
  sqlite3* handle_ = nullptr;
  std::map<std::string, Statement, std::less<>> statements_;
};

// Rolls back at the end of its scope unless committed.
class Transaction {
 public:
  enum class Kind { read, write };
  Transaction(Database& database, Kind kind);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  void commit();

 private:
  Database& database_;
};

}  // namespace joulecast::history
