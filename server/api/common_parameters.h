#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/json_writer.h"
#include "history/store.h"
#include "server/api/csv.h"
#include "server/http/router.h"

// Parameters that several endpoints share.
namespace joulecast::api {

// The {id} of a path, or its {`name`}, as the positive integer of a `thing`. Fault::not_found for other text.
Result<std::int64_t> path_id(const http::Request& request, std::string_view thing,
                             const std::string& name = "id");

// A number or an integer within bounds.
http::Parameter bounded(http::Parameter::Type type, std::string name, std::string words,
                        std::optional<double> minimum = {}, std::optional<double> maximum = {});

// ?digits=: significant digits of the numbers in the response.
http::Parameter digits_parameter();

// ?limit=: largest number of `things`, e.g. "missions a page", in the response.
http::Parameter limit_parameter(const std::string& things, std::int64_t usual, std::int64_t maximum);

// ?cursor=: the next_cursor of the page before.
http::Parameter cursor_parameter();
// The cursor as an id: the page begins after it, in the list's order. Fault::invalid for any other text.
Result<std::optional<std::int64_t>> id_cursor(const http::Request& request);
// The id of the last item as the next cursor; empty if the page is not full.
template <class Items, class Id>
std::string next_id_cursor(const Items& items, std::int64_t limit, Id id_of) {
  return std::cmp_less(items.size(), limit) ? "" : std::to_string(std::invoke(id_of, items.back()));
}

// Writes an item by a table or a function.
template <class Item, class Write>
void write_item(JsonWriter& json, const Item& item, const Write& write) {
  if constexpr (std::is_invocable_v<Write, JsonWriter&, const Item&>)
    write(json, item);
  else
    write.write(json, item);
}

// A page: the members that `head` writes, the items by `write`, "next_cursor", null for an empty `cursor`.
template <class Items, class Write>
http::Response page_response(
    std::string_view name, const Items& items, const Write& write, std::string_view cursor,
    const std::function<void(JsonWriter&)>& head = [](JsonWriter&) {}) {
  JsonWriter json;
  head(json.begin_object());
  json.key(name).begin_array();
  for (const auto& item : items) write_item(json, item, write);
  json.end_array().key("next_cursor");
  cursor.empty() ? json.null() : json.value(cursor);
  return http::json_response(json.end_object().take());
}

// The same items as CSV.
template <class Items, class Write>
http::Response csv_response(const http::Request& request, const std::string& name, std::string_view columns,
                            const Items& items, const Write& write, std::string_view cursor = {}) {
  Csv csv(request, columns);
  for (const auto& item : items) {
    JsonWriter json;
    write_item(json, item, write);
    csv.row(json.text());
  }
  return csv.response(name, cursor);
}

// The page of ids that ?cursor= and ?limit= select, and the next cursor; empty: it is the last.
std::pair<std::vector<std::string>, std::string> page_of_ids(const http::Request& request,
                                                             const std::set<std::string>& ids);

// Of a log of events or requests: ?kind= with `kinds`, ?order= and default, ?from=, ?to=, ?limit=, ?cursor=.
std::vector<http::Parameter> log_parameters(std::string kinds, std::string_view usual_order);
// These and ?robot_id= as the query of the store.
struct LogQuery {
  std::int64_t behind_id = 0, limit = 0;
  history::LogFilter filter;
};
Result<LogQuery> log_query(const http::Request& request, std::string_view usual_order);

// ?limit= and ?cursor= of a list that the store pages.
history::PageRequest page_of(const http::Request& request);

std::vector<http::Parameter> with(std::vector<http::Parameter> parameters, std::vector<http::Parameter> more);

// ?robot_id=: ids separated by commas; empty where it is absent. Fault::invalid where it names none.
Result<std::vector<std::string>> robot_ids_of(const http::Request& request);

// ?from= and ?to= in ISO 8601, or ?from_utime_us= and ?to_utime_us=. `things` are limited to the range.
std::vector<http::Parameter> range_parameters(const std::string& things);
// The range, unlimited where it has no parameter. Fault::invalid for text in another form, for a time in both
// forms, and for a beginning after the end.
Result<history::TimeRange> range_of(const http::Request& request);

}  // namespace joulecast::api
