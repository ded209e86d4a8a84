#include <limits>

#include "base/json_writer.h"
#include "base/try.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// The audit log of requests.
namespace joulecast::api {
namespace {

using http::Request;
using http::Response;

void write_text_or_null(JsonWriter& out, const char* name, const std::string& text) {
  out.key(name);
  text.empty() ? out.null() : out.value(text);
}

Result<Response> audit(const Services& services, const Request& request) {
  TRY_ASSIGN(const auto cursor, id_cursor(request));
  const std::int64_t limit = request.query_integer("limit").value_or(100);
  TRY_ASSIGN(const auto found,
             services.store.audit(cursor.value_or(std::numeric_limits<std::int64_t>::max()), limit));
  JsonWriter out;
  out.begin_object().key("entries").begin_array();
  for (const history::AuditEntry& entry : found) {
    out.begin_object().field("id", entry.id).time("", entry.utime_us);
    write_text_or_null(out, "actor", entry.actor);
    write_text_or_null(out, "address", entry.address);
    write_text_or_null(out, "request_id", entry.request_id);
    out.field("action", entry.action).key("detail").raw(entry.detail_json);
    out.field("hash", entry.hash).end_object();
  }
  out.end_array();
  write_id_cursor(out, found, limit, [](const history::AuditEntry& entry) { return entry.id; });
  out.end_object();
  return http::json_response(out.take());
}

}  // namespace

std::vector<TableRow> audit_rows() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = http::Method::get,
        .path = "/v1/audit",
        .operation_id = "listAudit",
        .role = http::Role::admin,
        .summary = "Changes, rejected requests and sign-ins with their tokens, newest first; joulecast audit "
                   "verify checks the chain of hashes",
        .parameters = {limit_parameter("entries a page", history::max_page_size), cursor_parameter()},
        .response_schema = "audit"},
       answered_by(audit)});
  return rows;
}

}  // namespace joulecast::api
