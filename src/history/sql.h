#pragma once

#include <boost/core/noncopyable.hpp>
#include <cstddef>
#include <cstdint>
#include <forward_list>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

// An SQL database in four types: Database, Statement, Rows (a statement being run) and Transaction. sqlite.h
// and postgres.h implement the first two; the statements of this folder are written in the SQL that both
// support. They throw SqlError, which never leaves this folder: the store's interface makes it an Error.
namespace joulecast::history {

class SqlError : public std::runtime_error {
 public:
  enum class Kind {
    values,           // they are at fault and not the database: a broken constraint, a value too big
    unavailable,      // for now
    connection_lost,  // unavailable; the transaction on the connection is rolled back
    commit_unknown,   // unavailable; the connection was lost during COMMIT
    corrupt,
    internal
  };
  SqlError(Kind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}

  Kind kind() const { return kind_; }
  // corrupt, unavailable or internal.
  Fault fault() const;
  bool is_about_values() const { return kind_ == Kind::values; }

 private:
  Kind kind_;
};

// A prepared statement. Runs through Rows, one at a time. Parameters and columns count from 0.
class Statement : boost::noncopyable {
 public:
  enum class Type { null, integer, real, text, blob };

  virtual ~Statement() = default;

  virtual void bind_null(int parameter) = 0;
  virtual void bind(int parameter, std::int64_t value) = 0;
  virtual void bind(int parameter, double value) = 0;
  virtual void bind(int parameter, std::string_view value) = 0;
  virtual void bind(int parameter, std::span<const std::byte> value) = 0;
  // Steps to the next row; false after the last one.
  virtual bool step() = 0;
  // Steps to the end, perhaps later: by the next statement of the connection that waits for its result, which
  // then throws this one's error.
  virtual void step_later() = 0;
  // Rows changed, after the last step.
  virtual std::int64_t changed() const = 0;
  // Drops results and bound values.
  virtual void reset() = 0;

  virtual int columns() const = 0;
  virtual Type type(int column) const = 0;
  virtual std::int64_t integer(int column) const = 0;
  virtual double real(int column) const = 0;
  // Valid until the next step.
  virtual std::string_view bytes(int column) const = 0;
};

// One connection, used by one thread at a time.
class Database {
 public:
  enum class Access { read, write };

  virtual ~Database() = default;

  // Runs statements that give no rows worth reading.
  virtual void execute(const std::string& sql) = 0;
  // A statement that is not kept: for texts of which there are many. Parameters are written ?, or ?1, ?2 and
  // so on when one is used more than once.
  virtual std::unique_ptr<Statement> prepare(std::string_view sql) = 0;
  // Waits for the statements of run_later(), and throws their error.
  virtual void finish_later() {}
  // The statement of that text, prepared once and kept.
  Statement& statement(std::string_view sql);
  // The first column of the first row of a query without parameters.
  std::int64_t integer(std::string_view sql);
  std::string text(std::string_view sql);

  virtual bool has_table(std::string_view name) = 0;
  // Whether it is a PostgreSQL, to which several programs may write at the same time.
  virtual bool is_postgres() const { return false; }

  // False if the connection is lost permanently.
  virtual bool is_usable() const { return true; }
  virtual bool in_transaction() const = 0;
  // A reading one sees one snapshot throughout.
  virtual void begin(Access access) = 0;
  virtual void commit() = 0;
  virtual void roll_back() = 0;

 protected:
  // A statement that is kept.
  virtual std::unique_ptr<Statement> prepare_to_keep(std::string_view sql) { return prepare(sql); }
  void forget_statements() { statements_.clear(); }

 private:
  std::map<std::string, std::unique_ptr<Statement>, std::less<>> statements_;
};

// One run of a statement: bind its parameters left to right, then step; read a row's columns left to right.
// Resets the statement at the end of its scope. Bound text and blobs must outlive it, but for temporary ones.
class Rows : boost::noncopyable {
 public:
  explicit Rows(Statement& statement) : statement_(statement) {}
  // Of the kept statement of that text, with these parameters.
  template <class... Values>
  Rows(Database& database, std::string_view sql, Values&&... values) : Rows(database.statement(sql)) {
    (bind(std::forward<Values>(values)), ...);
  }
  ~Rows() { statement_.reset(); }

  Rows& bind(std::int64_t value);
  Rows& bind(bool value) { return bind(std::int64_t{value}); }
  Rows& bind(double value);  // NaN binds NULL
  Rows& bind(std::string_view value);
  Rows& bind(const char* value) { return bind(std::string_view(value)); }
  Rows& bind(const std::string& value) { return bind(std::string_view(value)); }
  Rows& bind(std::string&& value) { return bind(owned_.emplace_front(std::move(value))); }
  Rows& bind(std::span<const std::byte> value);
  Rows& bind_null();
  template <class T>
  Rows& bind(const std::optional<T>& value) {
    return value ? bind(*value) : bind_null();
  }

  // Steps to the next row; false after the last one.
  bool next();
  // Steps a statement that gives no rows; answers the number of rows it changed.
  std::int64_t run();
  // Steps a statement with an unused result; see Statement::step_later().
  void run_later() { statement_.step_later(); }

  int columns() const { return statement_.columns(); }
  Statement::Type type() const { return statement_.type(column_); }  // of the next column
  std::int64_t integer() { return statement_.integer(column_++); }   // NULL reads 0
  bool boolean() { return integer() != 0; }
  double real();  // NULL reads NaN
  std::string text() { return std::string(statement_.bytes(column_++)); }
  std::span<const std::byte> blob();  // valid until the next step
  std::optional<std::int64_t> optional_integer();

 private:
  Statement& statement_;
  std::forward_list<std::string> owned_;  // bound texts
  int parameter_ = 0;
  int column_ = 0;
};

// Rolls back at the end of its scope unless committed.
class Transaction : boost::noncopyable {
 public:
  Transaction(Database& database, Database::Access access) : database_(database) { database.begin(access); }
  ~Transaction();

  void commit() { database_.commit(); }

 private:
  Database& database_;
};

// The names of comma-separated columns.
std::vector<std::string> column_names(std::string_view columns);

// " ON CONFLICT (key) DO UPDATE SET ...": an insert replaces the columns of the row of the same key.
std::string or_replace(std::string_view key, std::string_view columns);

// "INSERT INTO table (columns) VALUES (?, ...)".
std::string insert_into(std::string_view table, std::string_view columns);

// "INSERT INTO table (key, columns) VALUES (?, ...)", replacing those of the same key. Comma-separated.
std::string insert_or_replace(std::string_view table, std::string_view key, std::string_view columns);

// "?, ?, ?" for as many as the comma-separated columns.
std::string placeholders(std::string_view columns);

}  // namespace joulecast::history
