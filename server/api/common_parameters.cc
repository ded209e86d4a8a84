#include "server/api/common_parameters.h"

#include <charconv>
#include <utility>

namespace joulecast::api {

using http::Parameter;

Result<std::int64_t> path_id(const http::Request& request, std::string_view thing) {
  const std::string& text = request.param("id");
  std::int64_t id = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (fault != std::errc() || end != text.data() + text.size() || id <= 0)
    return fail(Fault::not_found, "id",
                "\"" + text + "\" names no " + std::string(thing) + ": ids are positive integers");
  return id;
}

Parameter limit_parameter(std::string things, std::int64_t maximum) {
  return {.name = "limit",
          .type = Parameter::Type::integer,
          .description = std::move(things),
          .minimum = 1,
          .maximum = static_cast<double>(maximum)};
}

Parameter before_parameter() {
  return {.name = "before",
          .type = Parameter::Type::integer,
          .description = "only those with a smaller id",
          .minimum = 1};
}

}  // namespace joulecast::api
