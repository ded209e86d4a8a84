#include "base/try.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"

// The audit log of requests.
namespace joulecast::api {
namespace {

constexpr std::string_view usual_request_order = "desc";

const auto entry_table =
    Table<history::AuditEntry>()
        .value("id", AT(id), "1, 2, 3 ..., without a gap")
        .time("", AT(utime_us), "time of storage, microseconds since 1970 by the host's clock")
        .text_or_null("actor", AT(actor), "name of the token; null: no authenticated client")
        .text_or_null("address", AT(address), "IP address of the client; null: the daemon itself")
        .text_or_null("request_id", AT(request_id),
                      "X-Request-Id of the request and its answer; null: no request")
        .value("action", AT(action), "operationId of the request, or another event such as token_added")
        .json("detail", AT(detail_json), "parameters of the request, or the status of the response",
              described::of_type("object"))
        .value("hash", AT(hash), "SHA-256 over the hash of the entry before and this entry");

Result<Response> audit(const Services& services, const Request& request) {
  TRY_ASSIGN(const LogQuery query, log_query(request, usual_request_order));
  TRY_ASSIGN(const auto found, services.store.audit(query.behind_id, query.limit, query.filter));
  return page_response("entries", found, entry_table,
                       next_id_cursor(found, query.limit, &history::AuditEntry::id));
}

}  // namespace

Part audit_part() {
  Part part;
  part.add(Method::get, "/v1/audit", "listAudit", Role::admin,
           "Changes, rejected requests and sign-ins with their tokens; joulecast audit verify checks the "
           "chain of hashes",
           {"audit", described::of_page("Entries of the audit", "entries", "in the requested order",
                                        entry_table.of_member())},
           audit, {.parameters = log_parameters("only entries of this action", usual_request_order)});
  return part;
}

}  // namespace joulecast::api
