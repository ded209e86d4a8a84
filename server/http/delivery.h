#pragma once

#include <memory>
#include <string>

#include "server/http/router.h"

namespace joulecast::http {

// Completes every answer of an endpoint: numbers rounded according to ?digits=, an ETag, the answer 304 to a
// client with a current copy, and the content coding that the client accepts, for bodies above a kilobyte and
// for streams except event streams. `on_io`: on the I/O thread no body is coded, since a long one would delay
// all others.
void deliver(const Endpoint& endpoint, const Request& request, Response& response, bool on_io);

// Weak: it holds for every content coding. "W/\"<hash>\"".
std::string entity_tag(std::string_view bytes);

// A document that is fixed while the service runs, kept plain and, where that is smaller, gzipped.
class Asset {
 public:
  Asset(std::string bytes, std::string content_type, std::string cache_control);

  // The form that the client takes, with an ETag; 304 where it has it.
  Response answer(const Request& request) const;

 private:
  std::string content_type_, cache_control_;
  std::shared_ptr<const std::string> plain_;
  std::shared_ptr<const std::string> gzipped_;  // null where gzip does not pay
  std::string plain_tag_, gzipped_tag_;
};

}  // namespace joulecast::http
