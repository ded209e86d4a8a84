#pragma once

#include <boost/core/noncopyable.hpp>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/sql.h"

struct sqlite3;

namespace joulecast::history {

enum class OpenMode { read_write_create, read_only };

class SqliteDatabase final : public Database {
 public:
  SqliteDatabase(const std::string& path, OpenMode mode, std::int64_t busy_timeout_ms);
  ~SqliteDatabase() override;

  void execute(const std::string& sql) override;
  std::unique_ptr<Statement> prepare(std::string_view sql) override;
  bool has_table(std::string_view name) override;
  bool in_transaction() const override;
  void begin(Access access) override;
  void commit() override { Rows(statement("COMMIT")).run(); }
  void roll_back() override { Rows(statement("ROLLBACK")).run(); }

 private:
  sqlite3* handle_ = nullptr;
};

// Keeps a second program off the same file; the kernel releases it however the process ends.
class FileLock : boost::noncopyable {
 public:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  ~FileLock();

  // Creates the file if it is missing. Fault::conflict if another program holds the lock; with `names_holder`
  // the file contains its process, which the message names.
  static Result<std::unique_ptr<FileLock>> acquire(const std::string& path, bool names_holder);

 private:
  int descriptor_;
};

// The locks of a store: one on the lock file next to it, which excludes other programs before anything is
// read, and one on the database itself, which remains if the lock file is deleted.
Result<std::vector<std::unique_ptr<FileLock>>> lock_store(const std::string& path);

}  // namespace joulecast::history
