#pragma once

#include "server/http/router.h"

namespace joulecast::http {

// What every answer of an endpoint gets on its way out: numbers rounded as ?digits= says, an ETag and the
// answer 304 to a client that has it already, and the content coding that the client takes, for bodies above
// a kilobyte and for streams but event streams. `on_io`: on the I/O thread nothing is coded, since a long
// body would hold up all others.
void deliver(const Endpoint& endpoint, const Request& request, Response& response, bool on_io);

// Weak: it holds for every content coding. "W/\"<hash>\"".
std::string entity_tag(std::string_view bytes);

}  // namespace joulecast::http
