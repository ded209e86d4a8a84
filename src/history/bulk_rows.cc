#include "history/bulk_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "history/schema.h"

namespace joulecast::history {

BulkRows::BulkRows(std::string table, std::string columns,
                   std::function<std::string(const std::string& from)> sql)
    : table_(std::move(table)), columns_(std::move(columns)), sql_(std::move(sql)) {
  row_.resize(column_names(columns_).size());
  collected_.resize(row_.size());
}

std::string& BulkRows::at(int parameter) {
  return row_.at(static_cast<std::size_t>(parameter));
}

void BulkRows::bind_null(int parameter) {
  at(parameter) = "NULL";
}

void BulkRows::bind(int parameter, std::int64_t value) {
  at(parameter) = fmt::to_string(value);
}

void BulkRows::bind(int parameter, double value) {
  at(parameter) = fmt::to_string(value);
}

// Within quotes a backslash stands before quotes and backslashes.
void BulkRows::bind(int parameter, std::string_view value) {
  std::string& text = at(parameter);
  text = '"';
  for (const char c : value) {
    if (c == '"' || c == '\\') text += '\\';
    text += c;
  }
  text += '"';
}

void BulkRows::bind(int parameter, std::span<const std::byte> value) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string& text = at(parameter);
  text = "\"\\\\x";
  text.reserve(2 * value.size() + 8);
  for (const std::byte byte : value) {
    text += digits[std::to_integer<unsigned>(byte) >> 4U];
    text += digits[std::to_integer<unsigned>(byte) & 15U];
  }
  text += '"';
}

void BulkRows::step_later() {
  for (std::size_t k = 0; k < row_.size(); ++k) {
    collected_[k] += any_ ? ',' : '{';
    collected_[k] += row_[k];
  }
  any_ = true;
}

void BulkRows::reset() {
  for (std::string& value : row_) value = "NULL";
}

void BulkRows::clear() {
  for (std::string& values : collected_) values.clear();
  any_ = false;
}

std::string BulkRows::from() const {
  const auto table = std::ranges::find(store_tables(), table_, &Table::name);
  std::string text = "unnest(";
  for (const std::string& column : column_names(columns_)) {
    const auto of = std::ranges::find(table->columns, column, [](const auto& each) { return each.first; });
    text.append(text.back() == '(' ? "?::text::" : ", ?::text::");
    text.append(of->second == "TEXT" ? of->second : in_postgres(of->second)).append("[]");
  }
  return text + ") AS new (" + columns_ + ")";
}

void BulkRows::flush(Database& database) {
  if (!any_) return;
  if (text_.empty()) text_ = sql_(from());
  for (std::string& values : collected_) values += '}';
  Statement& statement = database.statement(text_);
  Rows rows(statement);
  for (const std::string& values : collected_) rows.bind(values);
  rows.run_later();
  clear();
}

BulkRows bulk_insert(const std::string& table, const std::string& columns, const std::string& on_conflict) {
  return {table, columns, [=](const std::string& from) {
            return "INSERT INTO " + table + " (" + columns + ") SELECT " + columns + " FROM " + from +
                   on_conflict;
          }};
}

BulkRows bulk_replace(const std::string& table, const std::string& key, const std::string& others) {
  return bulk_insert(table, key + ", " + others, or_replace(key, others));
}

}  // namespace joulecast::history
