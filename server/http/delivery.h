#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "server/http/message.h"
#include "server/http/router.h"

namespace joulecast::http {

// Completes every answer of an endpoint: numbers rounded according to ?digits=, an ETag, the answer 304 to a
// client with a current copy, and the content coding that the client accepts, for bodies above a kilobyte and
// for streams except event streams. `on_io`: on the I/O thread no body is coded, since a long one would delay
// all others.
void deliver(const Endpoint& endpoint, const Request& request, Response& response, bool on_io);

// Pages of other origins that browsers let use the service (Fetch standard, CORS). They authenticate by a
// token: cookies are not sent there, since a session's is SameSite=Strict.
class Cors {
 public:
  explicit Cors(std::vector<std::string> allowed_origins) : origins_(std::move(allowed_origins)) {}

  bool allows(std::string_view origin) const { return std::ranges::find(origins_, origin) != origins_.end(); }

  // Adds the headers that the browser requires in an answer, and in the answer to a preflight request.
  void add_headers(const Request& request, Response& response) const;

 private:
  std::vector<std::string> origins_;
};

// Fault::invalid for a text that is no origin, "https://name" or "http://name:port", in lower case.
Result<void> check_origin(std::string_view origin);

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

enum class Coding : std::uint8_t { identity, gzip, zstd };

std::string_view name(Coding coding);

// The coding to answer with: zstd before gzip, since it takes less time for fewer bytes; weights other than
// q=0 are not looked at.
Coding coding_of(std::string_view accept_encoding);

// The coded form; empty when the library fails, which it does for want of memory alone.
std::string coded(Coding coding, std::string_view bytes);

// A stream with coded pieces; the inner stream's output before it waits is flushed.
std::shared_ptr<StreamSource> coded(Coding coding, std::shared_ptr<StreamSource> inner);

}  // namespace joulecast::http
