#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/try.h"
#include "history/columns.h"
#include "history/sql.h"

// Records to and from rows, by their columns (columns.h).
namespace joulecast::history {

// The columns of a record from a number on, comma-separated; '' in place of those that are left out.
template <class Record>
std::string columns_of(int from = 0, std::initializer_list<std::string_view> left_out = {}) {
  std::string text;
  const Record record{};
  visit_columns(record, [&](std::string_view name, const auto&...) {
    if (from-- > 0) return;
    if (!text.empty()) text += ", ";
    text += std::ranges::find(left_out, name) == left_out.end() ? name : "''";
  });
  return text;
}

// Members of other types are stored as JSON.
void bind_value(Rows& rows, const std::string& text, NullIfEmpty);
void bind_value(Rows& rows, const std::string& text, AsBytes);
void bind_value(Rows& rows, const std::map<std::string, std::int64_t>& counts);
void bind_value(Rows& rows, const std::vector<CovariateSummary>& covariates);  // none: NULL
void bind_value(Rows& rows, const std::vector<MissionKey>& keys);
void bind_value(Rows& rows, const std::vector<std::array<double, 2>>& places);
template <class T>
void bind_value(Rows& rows, const T& value) {
  if constexpr (std::is_enum_v<T>)
    rows.bind(name(value));
  else
    rows.bind(value);
}

// Binds the members from a number on. The record must outlive the rows.
template <class Record>
void bind_record(Rows& rows, const Record& record, int from = 0) {
  visit_columns(record, [&](std::string_view, const auto& value, auto... how) {
    if (from-- <= 0) bind_value(rows, value, how...);
  });
}

// False if the column's text is not one that bind_value() binds.
bool read_value(Rows& rows, std::map<std::string, std::int64_t>& counts);
bool read_value(Rows& rows, std::vector<CovariateSummary>& covariates);
bool read_value(Rows& rows, std::vector<MissionKey>& keys);
bool read_value(Rows& rows, std::vector<std::array<double, 2>>& places);
template <class T>
bool read_value(Rows& rows, T& value) {
  if constexpr (Named<T>) {
    const std::optional<T> named = from_name<T>(rows.text());
    value = named.value_or(value);
    return named.has_value();
  } else if constexpr (std::same_as<T, bool>)
    value = rows.boolean();
  else if constexpr (std::same_as<T, std::int64_t>)
    value = rows.integer();
  else if constexpr (std::same_as<T, double>)
    value = rows.real();
  else if constexpr (std::same_as<T, std::string>)
    value = rows.text();
  else
    value = rows.optional_integer();
  return true;
}

// Reads the next columns.
template <class... Values>
void read_values(Rows& rows, Values&... values) {
  (read_value(rows, values), ...);
}

// Reads the columns of columns_of(). Fault::corrupt on a column with an invalid value.
template <class Record>
Result<Record> read_record(Rows& rows) {
  Record record;
  std::string_view invalid;
  visit_columns(record, [&](std::string_view name, auto& value, auto...) {
    if (!read_value(rows, value)) invalid = name;
  });
  if (!invalid.empty()) return fail(Fault::corrupt, std::string(invalid), "has an invalid value");
  return record;
}

// All rows, each through `read`, up to the first error.
template <class T>
Result<std::vector<T>> read_all(Rows& rows, Result<T> (*read)(Rows&) = read_record<T>) {
  std::vector<T> all;
  while (rows.next()) {
    TRY_ASSIGN(T one, read(rows));
    all.push_back(std::move(one));
  }
  return all;
}

// All rows, a name and its value each.
template <class Map>
Map read_by_name(Rows& rows) {
  Map all;
  while (rows.next()) {
    std::string name = rows.text();
    read_value(rows, all[std::move(name)]);
  }
  return all;
}

// The records of a table, "FROM table WHERE ...", with these parameters.
template <class Record, class... Values>
Result<std::vector<Record>> select_all(Database& database, std::string_view from, const Values&... values) {
  Rows rows(database, "SELECT " + columns_of<Record>() + ' ' + std::string(from), values...);
  return read_all<Record>(rows);
}
// The first one of them, if any.
template <class Record, class... Values>
Result<std::optional<Record>> select_one(Database& database, std::string_view from, const Values&... values) {
  Rows rows(database, "SELECT " + columns_of<Record>() + ' ' + std::string(from), values...);
  if (!rows.next()) return std::nullopt;
  return read_record<Record>(rows);
}

// Stores the record; see Statement::step_later().
template <class Record>
void insert_record(Database& database, std::string_view table, const Record& record) {
  Rows rows(database, insert_into(table, columns_of<Record>()));
  bind_record(rows, record);
  rows.run_later();
}

// "INSERT ...", in place of the record of the same key, which its first `keys` columns are.
template <class Record>
std::string replace_sql(std::string_view table, int keys) {
  const std::string all = columns_of<Record>(), others = columns_of<Record>(keys);
  return insert_or_replace(table, all.substr(0, all.size() - others.size() - 2), others);
}
template <class Record>
void replace_record(Database& database, std::string_view table, int keys, const Record& record) {
  Rows rows(database, replace_sql<Record>(table, keys));
  bind_record(rows, record);
  rows.run_later();
}

// Stores the record without its number, which is its first column; answers the number given to it.
template <class Record>
std::int64_t insert_numbered(Database& database, const std::string& table, const Record& record) {
  const std::string all = columns_of<Record>();
  Rows rows(database,
            insert_into(table, columns_of<Record>(1)) + " RETURNING " + all.substr(0, all.find(',')));
  bind_record(rows, record, 1);
  rows.next();
  const std::int64_t number = rows.integer();
  rows.run();
  return number;
}

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

  void bind_null(int parameter) override { at(parameter) = "NULL"; }
  void bind(int parameter, std::int64_t value) override { at(parameter) = std::to_string(value); }
  void bind(int parameter, double value) override;
  void bind(int parameter, std::string_view value) override;
  void bind(int parameter, std::span<const std::byte> value) override;
  void step_later() override;
  void reset() override {
    for (std::string& value : row_) value = "NULL";
  }

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
  std::string& at(int parameter) { return row_.at(static_cast<std::size_t>(parameter)); }

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
