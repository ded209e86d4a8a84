#pragma once

#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>

#include "base/error.h"
#include "server/api/services.h"

namespace joulecast::api {

// {"robots": [...], "request": {...}}; one row per robot in the requested order, by default by id.
Result<http::Response> fleet_autonomy_answer(const nlohmann::json& body, Services& services,
                                             const std::stop_token& stop);

}  // namespace joulecast::api
