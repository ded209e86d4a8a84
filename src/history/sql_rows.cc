#include "history/sql_rows.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "access/sha256.h"
#include "base/json_number.h"
#include "history/schema.h"

namespace joulecast::history {
namespace {

using nlohmann::json;

// False if the text is not the JSON of such a value, or one of its elements is not valid.
template <class T, class Valid>
bool read_json(const std::string& text, T& value, Valid is_valid) try {
  const json document = json::parse(text);
  document.get_to(value);
  return std::ranges::all_of(document, is_valid);
} catch (const json::exception&) {
  return false;
}

}  // namespace

const std::array<std::string, signals::term_count>& ledger_columns() {
  static const auto columns = [] {
    std::array<std::string, signals::term_count> all;
    for (std::size_t k = 0; k < all.size(); ++k)
      all[k].append("ledger_").append(signals::term_names[k]).append("_j");
    return all;
  }();
  return columns;
}

void bind_value(Rows& rows, const std::string& text, NullIfEmpty) {
  text.empty() ? rows.bind_null() : rows.bind(text);
}

void bind_value(Rows& rows, const std::string& text, AsBytes) {
  rows.bind(std::as_bytes(std::span(text)));
}

void bind_value(Rows& rows, const std::map<std::string, std::int64_t>& counts) {
  rows.bind(json_text(json(counts)));
}

void bind_value(Rows& rows, const std::vector<CovariateSummary>& covariates) {
  json all = json::array();
  for (const CovariateSummary& c : covariates)
    all.push_back({c.name, c.mean, c.min, c.max, c.known_s, c.counted_utime_us, c.value, c.value_utime_us});
  all.empty() ? rows.bind_null() : rows.bind(json_text(all));
}

void bind_value(Rows& rows, const std::vector<MissionKey>& keys) {
  rows.bind(json_text(json(keys)));
}

void bind_value(Rows& rows, const std::vector<std::array<double, 2>>& places) {
  rows.bind(json_text(json(places)));
}

bool read_value(Rows& rows, std::map<std::string, std::int64_t>& counts) {
  return read_json(rows.text(), counts, &json::is_number_integer);
}

bool read_value(Rows& rows, std::vector<CovariateSummary>& covariates) {
  const std::string text = rows.text();
  if (text.empty()) return true;
  const json all = json::parse(text, nullptr, false);
  const auto real = [](const json& value) {
    return value.is_number() ? value.get<double>() : signals::unmeasured;
  };
  for (const json& row : all) {
    if (!row.is_array() || row.size() != 8 || !row[0].is_string() || !row[5].is_number_integer() ||
        !row[7].is_number_integer())
      return false;
    covariates.push_back({row[0].get<std::string>(), real(row[1]), real(row[2]), real(row[3]), real(row[4]),
                          row[5].get<std::int64_t>(), real(row[6]), row[7].get<std::int64_t>()});
  }
  return all.is_array();
}

bool read_value(Rows& rows, std::vector<MissionKey>& keys) {
  return read_json(rows.text(), keys, &json::is_number_integer);
}

bool read_value(Rows& rows, std::vector<std::array<double, 2>>& places) {
  return read_json(rows.text(), places, [](const json& place) { return place.size() == 2; });
}

BulkRows::BulkRows(std::string table, std::string columns,
                   std::function<std::string(const std::string& from)> sql)
    : table_(std::move(table)), columns_(std::move(columns)), sql_(std::move(sql)) {
  row_.resize(column_names(columns_).size());
  collected_.resize(row_.size());
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
  const std::string_view bytes(reinterpret_cast<const char*>(value.data()), value.size());
  at(parameter) = "\"\\\\x" + access::hexadecimal(bytes) + '"';
}

void BulkRows::step_later() {
  for (std::size_t k = 0; k < row_.size(); ++k) {
    collected_[k] += any_ ? ',' : '{';
    collected_[k] += row_[k];
  }
  any_ = true;
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
