#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "describe/schema.h"
#include "server/embedded.h"
#include "server/http/router.h"

namespace joulecast::http {

// The schema of the document.
described::Schema openapi_schema();

// The OpenAPI 3.1 document of a table of endpoints and of GET /openapi.json, which serves it: paths,
// parameters, bodies and errors from the table, the components from the schemas it names and those they
// refer to, and from `examples` the examples of bodies, "<operation id>.request.json" and
// "<operation id>.answer.json". Pretty-printed and ending in a newline, so that schemas/openapi.json is this
// text. Fails with Fault::internal when a schema is missing.
Result<std::string> openapi_document(std::span<const Endpoint> endpoints, const described::Schemas& schemas,
                                     std::span<const EmbeddedFile> examples);

// The endpoints and GET /openapi.json, which serves openapi_document() of them.
Result<std::vector<Endpoint>> with_openapi(std::vector<Endpoint> endpoints, const described::Schemas& schemas,
                                           std::span<const EmbeddedFile> examples);

}  // namespace joulecast::http
