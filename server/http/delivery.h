#pragma once

#include "server/http/router.h"

namespace joulecast::http {

// Completes every answer of an endpoint: numbers rounded according to ?digits=, an ETag, the answer 304 to a
// client with a current copy, and the content coding that the client accepts, for bodies above a kilobyte and
// for streams except event streams. `on_io`: on the I/O thread no body is coded, since a long one would delay
// all others.
void deliver(const Endpoint& endpoint, const Request& request, Response& response, bool on_io);

// Weak: it holds for every content coding. "W/\"<hash>\"".
std::string entity_tag(std::string_view bytes);

}  // namespace joulecast::http
