#include "server/api/common_parameters.h"

#include <iterator>

#include "base/text.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "server/http/text.h"

namespace joulecast::api {

using http::Parameter;

Result<std::int64_t> path_id(const http::Request& request, std::string_view thing, const std::string& name) {
  const std::string& text = request.param(name);
  const auto id = to_number<std::int64_t>(text);
  if (!id || *id <= 0)
    return fail(Fault::not_found, name,
                "\"" + text + "\" names no " + std::string(thing) + ": ids are positive integers");
  return *id;
}

Parameter bounded(Parameter::Type type, std::string name, std::string words, std::optional<double> minimum,
                  std::optional<double> maximum) {
  return {.name = std::move(name),
          .type = type,
          .description = std::move(words),
          .minimum = minimum,
          .maximum = maximum};
}

Parameter digits_parameter() {
  return bounded(Parameter::Type::integer, "digits",
                 "significant digits of numbers that are no integers, " + std::to_string(http::usual_digits) +
                     " if absent; " + std::to_string(http::all_digits) + ": all",
                 2, http::all_digits);
}

Parameter limit_parameter(const std::string& things, std::int64_t usual, std::int64_t maximum) {
  Parameter limit = bounded(Parameter::Type::integer, "limit", things, 1, static_cast<double>(maximum));
  limit.usual = static_cast<double>(usual);
  return limit;
}

Parameter cursor_parameter() {
  return {
      .name = "cursor",
      .description = "the next_cursor of the page before; as CSV, the header Link contains the next page"};
}

Result<std::optional<std::int64_t>> id_cursor(const http::Request& request) {
  const auto text = request.query_value("cursor");
  if (!text) return std::nullopt;
  const auto id = to_number<std::int64_t>(*text);
  if (!id || *id < 0) return invalid("cursor", "must be the next_cursor of a page of this list");
  return id;
}

std::pair<std::vector<std::string>, std::string> page_of_ids(const http::Request& request,
                                                             const std::set<std::string>& ids) {
  const history::PageRequest wanted = page_of(request);
  std::vector<std::string> page;
  auto next = ids.upper_bound(wanted.cursor);
  while (std::cmp_less(page.size(), wanted.limit) && next != ids.end()) page.push_back(*next++);
  std::string cursor = next == ids.end() ? "" : page.back();
  return {std::move(page), std::move(cursor)};
}

std::vector<Parameter> log_parameters(std::string kinds, std::string_view usual_order) {
  std::string order_words = "asc: oldest first; desc: newest first; default: ";
  return with(range_parameters("entries"),
              {{.name = "kind", .description = std::move(kinds) + ", or these, separated by commas"},
               {.name = "order", .description = order_words.append(usual_order), .choices = {"asc", "desc"}},
               limit_parameter("entries a page", 100, history::max_page_size),
               cursor_parameter()});
}

Result<LogQuery> log_query(const http::Request& request, std::string_view usual_order) {
  LogQuery query;
  history::LogFilter& filter = query.filter;
  TRY_ASSIGN(filter.robot_ids, robot_ids_of(request));
  filter.kinds = http::listed(request.query_value("kind").value_or(""));
  TRY_ASSIGN(filter.range, range_of(request));
  filter.newest_first = request.query_value("order").value_or(usual_order) == "desc";
  TRY_ASSIGN(const auto cursor, id_cursor(request));
  query.behind_id = cursor.value_or(filter.newest_first ? history::whole_future : 0);
  query.limit = *request.query_integer("limit");
  return query;
}

history::PageRequest page_of(const http::Request& request) {
  history::PageRequest page;
  page.limit = *request.query_integer("limit");
  page.cursor = std::string(request.query_value("cursor").value_or(""));
  return page;
}

std::vector<Parameter> with(std::vector<Parameter> parameters, std::vector<Parameter> more) {
  parameters.insert(parameters.end(), std::make_move_iterator(more.begin()),
                    std::make_move_iterator(more.end()));
  return parameters;
}

Result<std::vector<std::string>> robot_ids_of(const http::Request& request) {
  const auto given = request.query_value("robot_id");
  if (!given) return std::vector<std::string>{};
  std::vector<std::string> ids = http::listed(*given);
  if (ids.empty()) return invalid("robot_id", "must name a robot");
  return ids;
}

std::vector<Parameter> range_parameters(const std::string& things) {
  const std::string forms(utc_forms);
  constexpr const char* as_number = "the same in microseconds since 1970";
  return {{.name = "from", .description = "only " + things + " from this time on, " + forms},
          bounded(Parameter::Type::integer, "from_utime_us", as_number),
          {.name = "to",
           .description = "only " + things + " before this time, " + forms + "; a date includes that day"},
          bounded(Parameter::Type::integer, "to_utime_us", as_number)};
}

Result<history::TimeRange> range_of(const http::Request& request) {
  history::TimeRange range;
  const auto read = [&](const std::string& name, auto parse, std::int64_t& time) -> Result<std::string> {
    const auto text = request.query_value(name);
    const std::string number = name + "_utime_us";
    const auto utime_us = request.query_integer(number);
    if (text && utime_us) return invalid(name, "must not be given with " + number);
    const auto parsed = text ? parse(*text) : utime_us;
    if (text && !parsed)
      return invalid(name, "is \"" + std::string(*text) + "\", must be " + std::string(utc_forms));
    time = parsed.value_or(time);
    return text ? name : number;
  };
  TRY_ASSIGN(const auto from, read("from", parse_utc, range.from_utime_us));
  TRY_ASSIGN(const auto to, read("to", parse_utc_end, range.to_utime_us));
  if (range.from_utime_us <= range.to_utime_us) return range;
  return invalid(from, "must not be later than " + to);
}

}  // namespace joulecast::api
