#include "history/sql.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace joulecast::history {

Fault SqlError::fault() const {
  if (kind_ == Kind::corrupt) return Fault::corrupt;
  return kind_ == Kind::values || kind_ == Kind::internal ? Fault::internal : Fault::unavailable;
}

Rows& Rows::bind(std::int64_t value) {
  statement_.bind(parameter_++, value);
  return *this;
}

Rows& Rows::bind(double value) {
  if (std::isnan(value)) return bind_null();
  statement_.bind(parameter_++, value);
  return *this;
}

Rows& Rows::bind(std::string_view value) {
  statement_.bind(parameter_++, value);
  return *this;
}

Rows& Rows::bind(std::span<const std::byte> value) {
  statement_.bind(parameter_++, value);
  return *this;
}

Rows& Rows::bind_null() {
  statement_.bind_null(parameter_++);
  return *this;
}

bool Rows::next() {
  column_ = 0;
  return statement_.step();
}

std::int64_t Rows::run() {
  while (next()) {
  }
  return statement_.changed();
}

double Rows::real() {
  const bool absent = type() == Statement::Type::null;
  const double value = statement_.real(column_++);
  return absent ? std::nan("") : value;
}

std::span<const std::byte> Rows::blob() {
  const std::string_view bytes = statement_.bytes(column_++);
  return {reinterpret_cast<const std::byte*>(bytes.data()), bytes.size()};
}

std::optional<std::int64_t> Rows::optional_integer() {
  const bool absent = type() == Statement::Type::null;
  const std::int64_t value = integer();
  return absent ? std::nullopt : std::optional(value);
}

Statement& Database::statement(std::string_view sql) {
  auto found = statements_.find(sql);
  if (found == statements_.end()) found = statements_.emplace(std::string(sql), prepare_to_keep(sql)).first;
  return *found->second;
}

std::int64_t Database::integer(std::string_view sql) {
  const auto once = prepare(sql);
  Rows rows(*once);
  return rows.next() ? rows.integer() : 0;
}

std::string Database::text(std::string_view sql) {
  const auto once = prepare(sql);
  Rows rows(*once);
  return rows.next() ? rows.text() : std::string();
}

Transaction::~Transaction() {
  // The database itself rolls back after some errors; then there is nothing left to end.
  if (!database_.in_transaction()) return;
  try {
    database_.roll_back();
  } catch (const SqlError&) {
    // The next transaction fails to begin and is reported.
  }
}

std::string placeholders(std::string_view columns) {
  std::string marks = "?";
  for (auto commas = std::count(columns.begin(), columns.end(), ','); commas > 0; --commas) marks += ", ?";
  return marks;
}

std::vector<std::string> column_names(std::string_view columns) {
  constexpr std::string_view separator = ", ";
  std::vector<std::string> names;
  for (std::size_t from = 0; from < columns.size();) {
    const std::size_t end = std::min(columns.find(separator, from), columns.size());
    names.emplace_back(columns.substr(from, end - from));
    from = end + separator.size();
  }
  return names;
}

std::string or_replace(std::string_view key, std::string_view columns) {
  std::string sql = " ON CONFLICT (" + std::string(key) + ") DO UPDATE SET ";
  std::string comma;
  for (const std::string& column : column_names(columns)) {
    sql += comma + column + " = excluded." + column;
    comma = ", ";
  }
  return sql;
}

std::string insert_into(std::string_view table, std::string_view columns) {
  return fmt::format("INSERT INTO {} ({}) VALUES ({})", table, columns, placeholders(columns));
}

std::string insert_or_replace(std::string_view table, std::string_view key, std::string_view columns) {
  return insert_into(table, std::string(key).append(", ").append(columns)) + or_replace(key, columns);
}

}  // namespace joulecast::history
