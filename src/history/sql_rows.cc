#include "history/sql_rows.h"

#include <nlohmann/json.hpp>

namespace joulecast::history {
namespace {

using nlohmann::json;

// A stray byte in a text must not throw.
std::string text_of(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

// Reads a JSON array, each element through `add`, which returns whether it is valid.
template <class Add>
bool read_array(const std::string& text, Add add) {
  const json all = json::parse(text, nullptr, false);
  return all.is_array() && std::ranges::all_of(all, add);
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
  rows.bind(text_of(counts));
}

void bind_value(Rows& rows, const std::vector<CovariateSummary>& covariates) {
  json all = json::array();
  for (const CovariateSummary& c : covariates)
    all.push_back({c.name, c.mean, c.min, c.max, c.known_s, c.counted_utime_us, c.value, c.value_utime_us});
  all.empty() ? rows.bind_null() : rows.bind(text_of(all));
}

void bind_value(Rows& rows, const std::vector<MissionKey>& keys) {
  rows.bind(text_of(keys));
}

void bind_value(Rows& rows, const std::vector<std::array<double, 2>>& places) {
  rows.bind(text_of(places));
}

bool read_value(Rows& rows, std::map<std::string, std::int64_t>& counts) {
  const json all = json::parse(rows.text(), nullptr, false);
  if (!all.is_object()) return false;
  for (const auto& [reason, count] : all.items()) {
    if (!count.is_number_integer()) return false;
    counts[reason] = count.get<std::int64_t>();
  }
  return true;
}

bool read_value(Rows& rows, std::vector<CovariateSummary>& covariates) {
  const std::string text = rows.text();
  const auto real = [](const json& value) {
    return value.is_number() ? value.get<double>() : signals::unmeasured;
  };
  return text.empty() || read_array(text, [&](const json& row) {
           if (!row.is_array() || row.size() != 8 || !row[0].is_string() || !row[5].is_number_integer() ||
               !row[7].is_number_integer())
             return false;
           covariates.push_back({row[0].get<std::string>(), real(row[1]), real(row[2]), real(row[3]),
                                 real(row[4]), row[5].get<std::int64_t>(), real(row[6]),
                                 row[7].get<std::int64_t>()});
           return true;
         });
}

bool read_value(Rows& rows, std::vector<MissionKey>& keys) {
  return read_array(rows.text(), [&](const json& key) {
    if (key.is_number_integer()) keys.push_back(key.get<MissionKey>());
    return key.is_number_integer();
  });
}

bool read_value(Rows& rows, std::vector<std::array<double, 2>>& places) {
  return read_array(rows.text(), [&](const json& place) {
    const bool is_valid =
        place.is_array() && place.size() == 2 && place[0].is_number() && place[1].is_number();
    if (is_valid) places.push_back(place.get<std::array<double, 2>>());
    return is_valid;
  });
}

}  // namespace joulecast::history
