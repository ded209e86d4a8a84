#pragma once

#include <any>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

// An endpoint's view of HTTP, independent of the library that implements the protocol.
namespace joulecast::http {

enum class Method : std::uint8_t { get, head, post, put, patch, del, options, other };

std::string_view to_string(Method method);

// The record of a request that changes data, stored in the transaction of the change.
struct Kept {
  std::string audit_action;                  // empty: it is not audited
  std::string idempotency_key, fingerprint;  // empty: it has no key
  bool committed = false;                    // all of this, with the change
};

// One request, valid for the duration of the handler's call. Header names and values are views into the
// connection's buffers; copy those that must live longer.
struct Request {
  Method method = Method::get;
  std::string_view target;                                 // as sent: path and query, still encoded
  std::string path;                                        // decoded
  std::vector<std::pair<std::string, std::string>> query;  // decoded, each key once
  std::vector<std::pair<std::string_view, std::string>>
      path_params;  // "{id}" of the template -> decoded segment
  std::vector<std::pair<std::string_view, std::string_view>> headers;
  std::string body;
  std::shared_ptr<const nlohmann::json> json;  // the parsed body where the endpoint declares a request schema
  std::any input;                              // result of an endpoint's `brief`, for its `handler`
  std::string address;                         // the client's, also where a trusted proxy passed it on
  std::string client;                          // the client that the limits count it for; empty: none
  bool secure = false;                         // came by HTTPS, all the way
  std::string actor;                           // name of the token that it came with; empty: none
  bool csv = false;                            // Accept requests text/csv from an endpoint that supports it
  bool deprecated = false;                     // came to an endpoint's former path
  std::string id;                              // the client's X-Request-Id if valid, else generated
  mutable Kept kept = {};                      // filled by the handler's wrapper
  // Set when the answer is no longer wanted: past http.request_deadline_s or when the client has gone (see
  // Run), and when the server's grace time at a stop has ended. The handler's result is then not sent.
  std::stop_token stop;

  // Value of a path parameter of the endpoint's template. A name that is not in the template aborts.
  const std::string& param(std::string_view name) const;
  // Decoded query value, or nullopt when the key is absent.
  std::optional<std::string_view> query_value(std::string_view name) const;
  // Query values that the router has checked against the endpoint's types and bounds.
  std::optional<double> query_number(std::string_view name) const;
  std::optional<std::int64_t> query_integer(std::string_view name) const;
  std::optional<bool> query_boolean(std::string_view name) const;
  // First header of that name in any case; empty when absent.
  std::string_view header(std::string_view name) const;
};

// A body that is produced piece by piece. The server requests the next piece only when the one before has
// been sent, so a slow client throttles its source. All calls for one stream are sequential.
class StreamSource {
 public:
  enum class Next : std::uint8_t {
    more,  // `out` holds a piece, call again when it has been written
    wait,  // nothing for now (`out` may hold a piece); call again after the wake function, or in a second
    end,   // `out` holds the last piece, which may be empty
    abort  // the stream is broken: close the connection without a proper end
  };
  virtual ~StreamSource() = default;
  // Appends the next piece to `out`.
  virtual Next pull(std::string& out) = 0;
  // Gives the function, callable from any thread and at any time, that makes the server pull again.
  virtual void on_wake(std::function<void()> /*wake*/) {}
  // The client left or the server stops; may come while pull() runs on another thread.
  virtual void cancel() {}
  // True when the source wants its connection closed even though a piece is still on its way (a slow client).
  virtual bool must_close() const { return false; }
  // True for streams that never end on their own: a graceful stop closes them immediately.
  virtual bool endless() const { return false; }
  // Where pull() runs: true when it computes or blocks.
  virtual bool on_worker() const { return true; }
};

// A stream from a function that appends the next piece and returns false after the last one. The token is set
// when the client has left. Runs on a worker.
std::shared_ptr<StreamSource> generate(
    std::function<bool(std::string& out, const std::stop_token& left)> next);

struct Response {
  unsigned status = 200;
  std::string content_type = "application/json";
  std::string body;
  std::shared_ptr<const std::string>
      shared_body;  // sent instead of `body` when set (assets, cached documents)
  std::vector<std::pair<std::string, std::string>> headers;
  std::shared_ptr<StreamSource> stream;  // sent instead of a body when set
  bool deprecated = false;               // its request has members of the version before
  std::string next_cursor;               // of a CSV that is a page: the next one's; empty: none

  std::string_view header(std::string_view name) const;  // as Request's
};

std::string_view body_of(const Response& response);

// A JSON answer with status 200 from text already serialised.
Response json_response(std::string body);

using Handler = std::function<Result<Response>(const Request&)>;

}  // namespace joulecast::http
