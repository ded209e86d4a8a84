#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/error.h"
#include "server/http/router.h"

// Parameters that several endpoints share.
namespace joulecast::api {

// The {id} of a path as the positive integer that names a `thing`. Fault::not_found for any other text.
Result<std::int64_t> path_id(const http::Request& request, std::string_view thing);

// ?limit=: how many `things`, e.g. "missions a page", are answered at most.
http::Parameter limit_parameter(std::string things, std::int64_t maximum);

// ?before=: where a list that runs from the newest backwards begins.
http::Parameter before_parameter();

}  // namespace joulecast::api
