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

Parameter digits_parameter() {
  return {.name = "digits",
          .type = Parameter::Type::integer,
          .description = "significant digits of numbers that are no integers, " +
                         std::to_string(http::usual_digits) + " if absent; " +
                         std::to_string(http::all_digits) + ": all",
          .minimum = 2,
          .maximum = http::all_digits};
}

Parameter limit_parameter(std::string things, std::int64_t maximum) {
  return {.name = "limit",
          .type = Parameter::Type::integer,
          .description = std::move(things),
          .minimum = 1,
          .maximum = static_cast<double>(maximum)};
}

Parameter cursor_parameter() {
  return {.name = "cursor", .description = "the next_cursor of the page before"};
}

Result<std::optional<std::int64_t>> id_cursor(const http::Request& request) {
  const auto text = request.query_value("cursor");
  if (!text) return std::nullopt;
  const auto id = to_number<std::int64_t>(*text);
  if (!id || *id < 0) return invalid("cursor", "must be the next_cursor of a page of this list");
  return id;
}

std::pair<std::vector<std::string>, std::string> page_of_ids(const http::Request& request,
                                                             const std::set<std::string>& ids,
                                                             std::int64_t limit) {
  const history::PageRequest wanted = page_of(request, limit);
  std::vector<std::string> page;
  auto next = ids.upper_bound(wanted.cursor);
  while (std::cmp_less(page.size(), wanted.limit) && next != ids.end()) page.push_back(*next++);
  std::string cursor = next == ids.end() ? "" : page.back();
  return {std::move(page), std::move(cursor)};
}

std::vector<Parameter> log_parameters(std::string kinds, std::string_view usual_order) {
  std::string order_words = "asc: oldest first; desc: newest first; default: ";
  const std::vector<Parameter> times = with(time_parameters("from", "only entries from this time on"),
                                            time_parameters("to", "only entries before this time"));
  return with(times,
              {{.name = "kind", .description = std::move(kinds) + ", or these, separated by commas"},
               {.name = "order", .description = order_words.append(usual_order), .choices = {"asc", "desc"}},
               limit_parameter("entries a page", history::max_page_size),
               cursor_parameter()});
}

Result<LogQuery> log_query(const http::Request& request, std::string_view usual_order) {
  LogQuery query;
  history::LogFilter& filter = query.filter;
  TRY_ASSIGN(filter.robot_ids, robot_ids_of(request));
  filter.kinds = http::listed(request.query_value("kind").value_or(""));
  TRY_ASSIGN(const auto from, time_of(request, "from"));
  TRY_ASSIGN(const auto to, time_of(request, "to"));
  filter.range = {from.value_or(history::whole_past), to.value_or(history::whole_future)};
  filter.newest_first = request.query_value("order").value_or(usual_order) == "desc";
  TRY_ASSIGN(const auto cursor, id_cursor(request));
  query.behind_id = cursor.value_or(filter.newest_first ? history::whole_future : 0);
  query.limit = request.query_integer("limit").value_or(100);
  return query;
}

history::PageRequest page_of(const http::Request& request, std::int64_t limit) {
  history::PageRequest page;
  page.limit = request.query_integer("limit").value_or(limit);
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

std::vector<Parameter> time_parameters(const std::string& name, const std::string& what) {
  return {{.name = name, .description = what + ", " + std::string(utc_forms)},
          {.name = name + "_utime_us",
           .type = Parameter::Type::integer,
           .description = "the same in microseconds since 1970"}};
}

Result<std::optional<std::int64_t>> time_of(const http::Request& request, const std::string& name) {
  const auto text = request.query_value(name);
  const auto utime_us = request.query_integer(name + "_utime_us");
  if (!text) return utime_us;
  if (utime_us) return invalid(name, "must not be given with " + name + "_utime_us");
  const auto parsed = parse_utc(*text);
  if (!parsed) return invalid(name, "is \"" + std::string(*text) + "\", must be " + std::string(utc_forms));
  return parsed;
}

}  // namespace joulecast::api
