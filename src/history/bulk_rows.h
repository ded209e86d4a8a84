#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "history/sql.h"

namespace joulecast::history {

// Rows of one statement, collected and sent as one: an array for each column, which the statement reads with
// unnest(). For PostgreSQL, where a statement costs far more than a row. Rows binds a row and run_later()
// ends it; no two rows may have the same key.
class BulkRows final : public Statement {
 public:
  // `columns`: comma-separated, those of the key first. `sql` returns the statement for the source of the
  // rows, "unnest(...) AS new (columns)".
  BulkRows(std::string table, std::string columns, std::function<std::string(const std::string& from)> sql);

  // Sends the collected rows, if any.
  void flush(Database& database);
  // Discards the collected rows.
  void clear();

  void bind_null(int parameter) override;
  void bind(int parameter, std::int64_t value) override;
  void bind(int parameter, double value) override;
  void bind(int parameter, std::string_view value) override;
  void bind(int parameter, std::span<const std::byte> value) override;
  void step_later() override;
  void reset() override;

  // It gives no rows.
  bool step() override { return false; }
  std::int64_t changed() const override { return 0; }
  int columns() const override { return 0; }
  Type type(int) const override { return Type::null; }
  std::int64_t integer(int) const override { return 0; }
  double real(int) const override { return 0; }
  std::string_view bytes(int) const override { return {}; }

 private:
  std::string from() const;
  std::string& at(int parameter);

  const std::string table_, columns_;
  const std::function<std::string(const std::string&)> sql_;
  std::string text_;                          // of the statement, once it is built
  std::vector<std::string> row_, collected_;  // a part of an array literal for each column
  bool any_ = false;
};

BulkRows bulk_insert(const std::string& table, const std::string& columns,
                     const std::string& on_conflict = {});
// Replaces rows of the same key; the key's columns are the first of `columns`.
BulkRows bulk_replace(const std::string& table, const std::string& key, const std::string& others);

}  // namespace joulecast::history
