#include "server/http/router.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/bounds.h"
#include "base/json_text.h"
#include "base/text.h"
#include "server/http/delivery.h"
#include "server/http/problem.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

[[noreturn]] void refuse_table(const Endpoint& endpoint, const char* why) {
  std::fprintf(stderr, "endpoint %s %s: %s\n", std::string(to_string(endpoint.method)).c_str(),
               endpoint.path.c_str(), why);
  std::abort();
}

// RFC 9110 section 12.5.1 without weights other than q=0, which excludes a range.
bool accepts(std::string_view accept, std::string_view type) {
  if (trimmed(accept).empty()) return true;
  const auto base = trimmed(type.substr(0, type.find(';')));
  const auto major = base.substr(0, base.find('/'));
  int best = -1;  // specificity of the range that decides
  bool allowed = false;
  while (!accept.empty()) {
    std::string_view item = take_item(accept, ',');
    const auto range = trimmed(take_item(item, ';'));
    bool zero = false;
    while (!item.empty()) {
      const auto part = trimmed(take_item(item, ';'));
      if (part.size() > 2 && lower(part[0]) == 'q' && part[1] == '=')
        zero = part.find_first_not_of("0.", 2) == std::string_view::npos;
    }
    const bool of_major = range.size() > 2 && range.ends_with("/*") &&
                          equals_ignoring_case(range.substr(0, range.size() - 2), major);
    const bool exact =
        equals_ignoring_case(range, base) ||
        (base.ends_with("/*") && equals_ignoring_case(range.substr(0, range.find('/')), major));
    const int specificity = range == "*/*" ? 0 : of_major ? 1 : exact ? 2 : -1;
    if (specificity > best) {
      best = specificity;
      allowed = !zero;
    } else if (specificity == best && specificity >= 0) {
      allowed = allowed || !zero;
    }
  }
  return allowed;
}

// Whether Accept names text/csv, before application/json where it names that too.
bool asks_for_csv(std::string_view accept) {
  while (!accept.empty()) {
    const auto item = take_item(accept, ',');
    const auto range = trimmed(item.substr(0, item.find(';')));
    if (equals_ignoring_case(range, "application/json")) return false;
    if (equals_ignoring_case(range, "text/csv")) return accepts(item, "text/csv");
  }
  return false;
}

bool is_json_type(std::string_view type) {
  const auto base = trimmed(type.substr(0, type.find(';')));
  return equals_ignoring_case(base, "application/json") ||
         (base.size() > 17 && equals_ignoring_case(base.substr(0, 12), "application/") &&
          equals_ignoring_case(base.substr(base.size() - 5), "+json"));
}

std::optional<std::string> broken_constraint(const Parameter& parameter, std::string_view text) {
  using Type = Parameter::Type;
  if (parameter.type == Type::text) {
    const auto& choices = parameter.choices;
    if (choices.empty() || std::ranges::find(choices, text) != choices.end()) return std::nullopt;
    std::string message = "must be one of";
    for (const auto& choice : choices) message += " " + choice;
    return message;
  }
  if (parameter.type == Type::boolean) {
    if (text == "true" || text == "false") return std::nullopt;
    return "must be true or false";
  }
  const bool whole = parameter.type == Type::integer;
  const auto value = whole ? std::optional<double>(to_number<std::int64_t>(text)) : to_number<double>(text);
  if (!value) return whole ? "must be an integer" : "must be a finite number";
  const Bounds none,
      bounds{parameter.minimum.value_or(none.minimum), parameter.maximum.value_or(none.maximum)};
  if (bounds.contain(*value)) return std::nullopt;
  return out_of_bounds(*value, bounds);
}

// The code that found an error names the field in its own terms; here it gets the name that the client used.
// A name that is no parameter is a member of the body, or, without a body, the object of the path.
std::string field_of(const Endpoint& endpoint, const Request& request, const Error& error) {
  const std::string& field = error.field;
  const unsigned status = status_of(error.fault);
  if (field.empty() || field.starts_with('/') || status >= 500) return field;
  const auto called = [&](const auto& each) { return each.first == field; };
  if (std::ranges::any_of(request.path_params, called) ||
      std::ranges::any_of(endpoint.parameters, [&](const Parameter& p) { return p.name == field; }))
    return field;
  if (!endpoint.request_schema.empty()) return "/" + field;
  if (status == 404 && request.path_params.size() == 1) return std::string(request.path_params.front().first);
  return field;
}

// The next page of a list as CSV (RFC 8288).
void add_link(const Request& request, Response& page) {
  std::string link = "<" + std::string(request.target.substr(0, request.target.find('?'))) + "?";
  for (const auto& [key, value] : request.query)
    if (key != "cursor") link += percent_encoded(key) + "=" + percent_encoded(value) + "&";
  link += "cursor=" + percent_encoded(page.next_cursor) + ">; rel=\"next\"";
  page.headers.emplace_back("Link", std::move(link));
}

// Depth-first with literal children first, so that "/v1/missions/latest" wins over "/v1/missions/{id}".
template <class Node>
const Node* descend(const Node& node, const std::vector<std::string>& segments, std::size_t at,
                    std::vector<const std::string*>& captured) {
  if (at == segments.size()) return node.slots.empty() ? nullptr : &node;
  if (const auto child = node.children.find(segments[at]); child != node.children.end())
    if (const Node* found = descend(*child->second, segments, at + 1, captured)) return found;
  if (node.any && !segments[at].empty()) {
    captured.push_back(&segments[at]);
    if (const Node* found = descend(*node.any, segments, at + 1, captured)) return found;
    captured.pop_back();
  }
  return nullptr;
}

}  // namespace

struct Router::Node {
  std::map<std::string, std::unique_ptr<Node>, std::less<>> children;
  std::unique_ptr<Node> any;  // the child of a "{name}" segment; names differ by endpoint and live there
  struct Slot {
    const Endpoint* endpoint;
    bool former;
    std::vector<std::string> names;  // of the "{...}" segments in order
  };
  std::vector<Slot> slots;
  std::string allow;  // value of the Allow header

  const Slot* slot(Method method) const {
    const auto found =
        std::ranges::find(slots, method, [](const Slot& each) { return each.endpoint->method; });
    return found != slots.end() ? &*found : nullptr;
  }
};

Router::Router(std::vector<Endpoint> endpoints, FaultSink on_fault, Guard guard)
    : endpoints_(std::move(endpoints)),
      on_fault_(std::move(on_fault)),
      guard_(std::move(guard)),
      root_(std::make_unique<Node>()) {
  const auto add = [this](const Endpoint& endpoint, const std::string& path) {
    const auto target = parse_target(path);
    if (!target || !target->query.empty()) refuse_table(endpoint, "malformed path template");
    if (!endpoint.handler) refuse_table(endpoint, "no handler");
    if (endpoint.operation_id.empty()) refuse_table(endpoint, "no operation id");
    Node* node = root_.get();
    Node::Slot slot{&endpoint, path == endpoint.former_path, {}};
    for (const std::string& segment : target->segments) {
      if (segment.size() > 2 && segment.front() == '{' && segment.back() == '}') {
        if (!node->any) node->any = std::make_unique<Node>();
        node = node->any.get();
        slot.names.push_back(segment.substr(1, segment.size() - 2));
      } else if (segment.find_first_of("{}") != std::string::npos) {
        refuse_table(endpoint, "a template segment must be one whole {name}");
      } else {
        auto& child = node->children[segment];
        if (!child) child = std::make_unique<Node>();
        node = child.get();
      }
    }
    if (node->slot(endpoint.method) != nullptr) refuse_table(endpoint, "the method and path shape are taken");
    node->slots.push_back(std::move(slot));
    if (!node->allow.empty()) node->allow += ", ";
    node->allow += to_string(endpoint.method);
    if (endpoint.method == Method::get) node->allow += ", HEAD";
  };
  for (const Endpoint& endpoint : endpoints_) {
    add(endpoint, endpoint.path);
    if (!endpoint.former_path.empty()) add(endpoint, endpoint.former_path);
  }
}

Router::~Router() = default;

Router::Match Router::match(Request& request) const {
  request.path_params.clear();
  request.query.clear();
  request.json.reset();
  request.path.clear();
  const auto refused = [&](unsigned status, std::string_view slug, std::string_view detail,
                           std::string_view field, std::string_view constraint) -> Match {
    return {nullptr, problem(status, slug, detail, request.id, field, constraint)};
  };
  auto target = parse_target(request.target);
  if (!target)
    return refused(400, "malformed-request", describe(target.error()), target.error().field,
                   target.error().message);
  for (const auto& segment : target->segments) request.path.append("/").append(segment);
  request.query = std::move(target->query);

  std::vector<const std::string*> captured;
  const Node* node = descend(*root_, target->segments, 0, captured);
  if (node == nullptr)
    return refused(404, "not-found", "No resource at " + request.path, "path",
                   "must be one of the paths of /openapi.json");
  const Node::Slot* slot = node->slot(request.method == Method::head ? Method::get : request.method);
  if (slot == nullptr) {
    const std::string allow = node->allow + ", OPTIONS";
    Match match =
        refused(405, "method-not-allowed", "Allowed here: " + allow, "method", "must be one of " + allow);
    if (request.method == Method::options) {
      match.answer.emplace();
      match.answer->status = 204;
      match.answer->content_type.clear();
    }
    match.answer->headers.emplace_back("Allow", allow);
    return match;
  }
  const Endpoint& endpoint = *slot->endpoint;
  request.deprecated = slot->former;
  for (std::size_t i = 0; i < slot->names.size(); ++i)
    request.path_params.emplace_back(slot->names[i], *captured[i]);

  if (guard_)
    if (auto answer = guard_(endpoint, request)) return {&endpoint, std::move(answer)};
  request.csv = endpoint.csv && asks_for_csv(request.header("accept"));
  if (!request.csv && !accepts(request.header("accept"), endpoint.response_type))
    return refused(406, "not-acceptable", "This resource is served as " + endpoint.response_type, "Accept",
                   "must admit " + endpoint.response_type);
  if (!endpoint.request_schema.empty()) {
    if (!is_json_type(request.header("content-type")))
      return refused(415, "unsupported-media-type", "The body must be of type application/json",
                     "Content-Type", "must be application/json");
    const auto coding = trimmed(request.header("content-encoding"));
    if (!coding.empty() && !equals_ignoring_case(coding, "identity"))
      return refused(415, "unsupported-media-type", "The body must not be compressed", "Content-Encoding",
                     "must be identity");
  }
  for (const auto& [key, value] : request.query) {
    const auto parameter = std::ranges::find(endpoint.parameters, key, &Parameter::name);
    if (parameter == endpoint.parameters.end()) {
      std::string known =
          endpoint.parameters.empty() ? "this resource has no query keys" : "accepted query keys:";
      for (const auto& each : endpoint.parameters) known += " " + each.name;
      return refused(400, "unknown-query-key", "Unknown query key " + key + "; " + known, key, known);
    }
    if (const auto broken = broken_constraint(*parameter, value))
      return refused(422, "invalid", key + ": " + *broken, key, *broken);
  }
  for (const auto& parameter : endpoint.parameters) {
    if (request.query_value(parameter.name)) continue;
    if (parameter.required)
      return refused(422, "invalid", parameter.name + ": this query key is required", parameter.name,
                     "is required");
    if (parameter.usual) request.query.emplace_back(parameter.name, fmt::format("{}", *parameter.usual));
  }
  return {&endpoint, std::nullopt};
}

Response Router::run(const Endpoint& endpoint, Request& request) const {
  try {
    if (!endpoint.request_schema.empty() && !request.json) {
      auto body = parse_json(request.body);
      if (!body)
        return problem(400, "malformed-json", describe(body.error()), request.id, body.error().field,
                       body.error().message);
      request.json = std::make_shared<const nlohmann::json>(std::move(*body));
    }
    auto response = endpoint.handler(request);
    if (!response) return fault(endpoint, request, response.error());
    if (!response->next_cursor.empty()) add_link(request, *response);
    deliver(endpoint, request, *response, endpoint.run == Run::io);
    return std::move(*response);
  } catch (const std::exception& cause) {
    return fault(endpoint, request, Error{Fault::internal, "", cause.what()});
  }
}

std::optional<Response> Router::run_brief(const Endpoint& endpoint, Request& request) const {
  if (!may_be_brief(endpoint, request)) return std::nullopt;
  try {
    if (!endpoint.request_schema.empty()) {
      auto body = parse_json(request.body);
      if (!body) return std::nullopt;
      request.json = std::make_shared<const nlohmann::json>(std::move(*body));
    }
    std::optional<Response> response = endpoint.brief(request);
    if (response) deliver(endpoint, request, *response, true);
    return response;
  } catch (const std::exception&) {
    return std::nullopt;  // the handler meets it again and reports it
  }
}

Response Router::fault(const Endpoint& endpoint, const Request& request, const Error& error) const {
  if (status_of(error.fault) == 500 && on_fault_) on_fault_(endpoint, request, error);
  return problem(Error{error.fault, field_of(endpoint, request, error), error.message}, request.id);
}

}  // namespace joulecast::http
