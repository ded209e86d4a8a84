#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "access/token.h"
#include "server/http/message.h"

namespace joulecast::http {

using access::Role;

// Where an endpoint runs; each but `io` has threads and a queue of its own, so that none waits for another.
enum class Run : std::uint8_t {
  worker,  // reads the store or answers within some milliseconds
  io,      // neither blocks nor computes for more than some tens of microseconds: on the I/O thread, or, with
           // a body to parse, on a thread for that
  operations,  // reports how the service is
  compute,     // plans or forecasts; cancelled past the deadline and when its client leaves
  write        // changes the store; cancelled past the deadline only where it has not begun
};

// One query parameter. Values are checked before the handler runs; keys that are not declared are errors.
struct Parameter {
  enum class Type : std::uint8_t { text, integer, number, boolean };
  std::string name = {};
  Type type = Type::text;
  std::string description = {};
  std::optional<double> minimum = std::nullopt;
  std::optional<double> maximum = std::nullopt;
  bool required = false;
  std::vector<std::string> choices = {};       // for text: the only values allowed, when not empty
  std::optional<double> usual = std::nullopt;  // what a request without it has
};

// One kind of event of an event stream, for documents.
struct EventKind {
  std::string name;
  std::string schema;  // name of the schema of its data
  std::string description;
};

// One row of the table of endpoints. Routes, the Allow headers and the OpenAPI document all come from it.
// GET implies HEAD; OPTIONS is answered by the router.
struct Endpoint {
  Method method = Method::get;
  std::string path = {};          // template, e.g. "/v1/robots/{id}/profile"
  std::string former_path = {};   // of the version before; answered with a Deprecation header, undocumented
  std::string operation_id = {};  // e.g. "computeProfile"; also the label of the request metrics
  Role role = Role::unstated;     // that a request needs where tokens exist; unstated: no client has it
  std::string tag = {};           // group that documents list it in, one of openapi.cc's
  std::string summary = {};
  std::vector<Parameter> parameters = {};
  std::string request_schema = {};                   // its name; empty when there is no body
  std::vector<std::string> request_types = {};       // media types of a body that is not JSON
  std::optional<std::uint64_t> max_body_bytes = {};  // none: http.max_body_bytes
  std::string response_schema = {};                  // likewise; empty when the answer is not JSON
  std::string response_type = "application/json";
  std::vector<EventKind> events = {};  // of an event stream
  bool csv = false;                    // also served as text/csv: see Request::csv
  bool rounded = false;                // numbers rounded according to ?digits=; false: all digits
  bool etag = false;  // for resources that rarely change: with an ETag, so that a client can revalidate
  unsigned success_status = 200;
  std::vector<unsigned> error_statuses = {};  // beyond those the frame itself can answer
  Run run = Run::worker;
  // Answered even when all connections are taken, at a place kept for such requests.
  bool reserved = false;
  // Of a worker's endpoint, when set: tried first, where and as one of Run::io runs. It answers the
  // requests that are quickly answered and declines the others, which then go to `handler`.
  std::function<std::optional<Response>(Request&)> brief = {};
  bool documented = true;  // false: left out of the OpenAPI document (assets)
  Handler handler = {};
};

// The header with which a client marks a request as the repetition of one with a lost answer, according to
// draft-ietf-httpapi-idempotency-key-header.
inline constexpr std::string_view idempotency_header = "Idempotency-Key";
inline constexpr std::size_t longest_idempotency_key = 255;  // visible ASCII characters

// Whether requests of the endpoint may have a key: those that change stored data.
inline bool takes_idempotency_key(const Endpoint& endpoint) {
  return endpoint.method != Method::get && (endpoint.role == Role::operate || endpoint.role == Role::admin);
}

class Router {
 public:
  static constexpr std::size_t brief_body_bytes = 4096;

  // Called with every internal fault (answered with status 500), since the client gets only the request id.
  using FaultSink = std::function<void(const Endpoint&, const Request&, const Error&)>;

  // Answers instead of an endpoint if the client may not use it; called before anything of the request but
  // method and path is checked.
  using Guard = std::function<std::optional<Response>(const Endpoint&, Request&)>;

  // Two endpoints with the same method and path shape, or a malformed template, are our bug and abort.
  explicit Router(std::vector<Endpoint> endpoints, FaultSink on_fault = {}, Guard guard = {});
  ~Router();

  // The result of matching a request's head: an endpoint to run, or a final answer.
  struct Match {
    const Endpoint* endpoint = nullptr;  // also set with the answer of a guard
    std::optional<Response> answer;
  };

  // Fills path, query and path_params of the request from its target. Cheap; never blocks.
  Match match(Request& request) const;

  // Checks and parses the body, calls the handler, turns errors into problem documents. Never throws.
  Response run(const Endpoint& endpoint, Request& request) const;

  // Whether the endpoint's `brief` is to be tried: for bodies of at most `brief_body_bytes`.
  static bool may_be_brief(const Endpoint& endpoint, const Request& request) {
    return endpoint.brief && request.body.size() <= brief_body_bytes;
  }

  // The response of `brief`, if the endpoint has one and it answers.
  std::optional<Response> run_brief(const Endpoint& endpoint, Request& request) const;

  const std::vector<Endpoint>& endpoints() const { return endpoints_; }

 private:
  struct Node;

  Response fault(const Endpoint& endpoint, const Request& request, const Error& error) const;

  std::vector<Endpoint> endpoints_;
  FaultSink on_fault_;
  Guard guard_;
  std::unique_ptr<Node> root_;
};

}  // namespace joulecast::http
