#pragma once

#include <string_view>

#include "base/error.h"
#include "describe/schema.h"
#include "server/http/message.h"

namespace joulecast::http {

// Statuses of the faults. 400 is kept for requests that cannot be read at all (JSON syntax, percent-encoding,
// unknown or repeated query keys); one that is read but breaks a stated constraint is 422, like one without a
// solution.
//   invalid 422 · not_found 404 · conflict 409 · infeasible 422 · too_large 413 · unavailable 503
//   corrupt 500 · internal 500
unsigned status_of(Fault fault);

std::string_view reason_phrase(unsigned status);

described::Schema problem_schema();

// RFC 9457 document, without empty `request_id`, `field` and `constraint`. 429 and 503 have Retry-After.
Response problem(unsigned status, std::string_view slug, std::string_view detail, std::string_view request_id,
                 std::string_view field = {}, std::string_view constraint = {});

// The problem of an error. Faults of ours (internal, corrupt) state no detail beyond the request id.
Response problem(const Error& error, std::string_view request_id);

}  // namespace joulecast::http
