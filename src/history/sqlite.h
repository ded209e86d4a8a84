#pragma once

#include <cstdint>
#include <string>

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
  void commit() override;
  void roll_back() override;

 private:
  sqlite3* handle_ = nullptr;
};

}  // namespace joulecast::history
