#include "server/http/problem.h"

#include <boost/beast/http/status.hpp>
#include <cstdint>
#include <map>
#include <optional>

#include "describe/table.h"

namespace joulecast::http {
namespace {

struct Answer {
  unsigned status;
  std::string_view slug;
};

Answer answer_to(Fault fault) {
  static const std::map<Fault, Answer> answers{
      {Fault::invalid, {422, "invalid"}},     {Fault::infeasible, {422, "infeasible"}},
      {Fault::not_found, {404, "not-found"}}, {Fault::conflict, {409, "conflict"}},
      {Fault::too_large, {413, "too-large"}}, {Fault::stopped, {503, "unavailable"}},
      {Fault::corrupt, {500, "corrupt"}},     {Fault::unavailable, {503, "unavailable"}},
      {Fault::internal, {500, "internal"}}};
  return answers.at(fault);
}

// A problem document. Absent members are left out.
struct Problem {
  std::string type;
  std::string_view title;
  std::uint64_t status;
  std::string_view detail;
  std::optional<std::string> instance = {};
  std::optional<std::string_view> request_id = {}, field = {}, constraint = {};
};

const auto problem_table =
    described::Table<Problem>("Problem document, RFC 9457")
        .value("type", AT(type), "urn:joulecast:problem:<kind>")
        .value("title", AT(title), "the status in words")
        .value("status", AT(status), "status of the answer", {{"minimum", 400}, {"maximum", 599}})
        .value("detail", AT(detail), "description of the error in this request")
        .known("instance", AT(instance), "urn:joulecast:request:<request id>")
        .known("request_id", AT(request_id), "the id under which the service logged the request")
        .known("field", AT(field),
               "JSON pointer into the body (begins with /), or the name of a query or path parameter or of "
               "a header")
        .known("constraint", AT(constraint), "the violated constraint, with value and bound")
        .elsewhere("back_test", described::of_reference("back-test"), "back-test of a rejected adoption");

}  // namespace

described::Schema problem_schema() {
  return problem_table.schema();
}

unsigned status_of(Fault fault) {
  return answer_to(fault).status;
}

std::string_view reason_phrase(unsigned status) {
  // Renamed by RFC 9110.
  if (status == 413) return "Content Too Large";
  if (status == 422) return "Unprocessable Content";
  const auto phrase = boost::beast::http::obsolete_reason(boost::beast::http::int_to_status(status));
  return {phrase.data(), phrase.size()};
}

Response problem(unsigned status, std::string_view slug, std::string_view detail, std::string_view request_id,
                 std::string_view field, std::string_view constraint) {
  Problem document{.type = "urn:joulecast:problem:" + std::string(slug),
                   .title = reason_phrase(status),
                   .status = status,
                   .detail = detail};
  if (!request_id.empty()) {
    document.instance = "urn:joulecast:request:" + std::string(request_id);
    document.request_id = request_id;
  }
  if (!field.empty()) document.field = field;
  if (!constraint.empty()) document.constraint = constraint;
  Response response;
  response.status = status;
  response.content_type = "application/problem+json";
  // Messages can quote the client's input, which need not be UTF-8.
  response.body = problem_table.document(document).dump();
  if (status == 429 || status == 503) response.headers.emplace_back("Retry-After", "1");
  return response;
}

Response problem(const Error& error, std::string_view request_id) {
  const auto [status, slug] = answer_to(error.fault);
  if (status == 500)
    return problem(status, slug,
                   "The service failed on this request; its log has the cause under the request id.",
                   request_id);
  return problem(status, slug, describe(error), request_id, error.field,
                 status != 503 ? std::string_view(error.message) : std::string_view{});
}

}  // namespace joulecast::http
