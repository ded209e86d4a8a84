#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "http_client/http_client.h"

namespace joulecast::server {

// A receiver of events by HTTP.
struct Webhook {
  std::string host;                    // with its port: the part of its URL that is no secret
  http_client::ServerAddress address;  // of its URL, path and query included
  std::string secret;                  // key of the signatures
  std::set<std::string> events;        // kinds that it receives
};

// {"webhooks": [{"url": "https://...", "secret_file": "path", "events": ["mission", ...]}]}. A relative
// secret_file is relative to the file's folder; it contains at least 16 bytes, not counting surrounding
// whitespace, and must not be readable by other users. "events" may be left out: all kinds. Faults name the
// JSON pointer.
Result<std::vector<Webhook>> read_webhooks(const std::string& path);

// Every kind that there is, in order of the alphabet: those of the event log and "mission", a mission that
// ended.
const std::set<std::string>& event_kinds();

}  // namespace joulecast::server
