#include "server/http/openapi.h"

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/json_text.h"
#include "base/try.h"
#include "server/http/delivery.h"
#include "server/http/gate.h"
#include "server/http/problem.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

using nlohmann::ordered_json;
constexpr std::string_view suffix = ".schema.json";

std::string lower_name(Method method) {
  std::string name(to_string(method));
  std::ranges::transform(name, name.begin(), lower);
  return name;
}

class Components {
 public:
  explicit Components(const described::Schemas& all) : all_(all) {}

  // {"$ref": ...} to the component of that name, which is taken in with all it refers to.
  Result<ordered_json> reference(const std::string& name) {
    TRY(add(name));
    return ordered_json{{"$ref", prefix_ + name}};
  }
  ordered_json take() {
    ordered_json sorted = ordered_json::object();
    for (auto& [name, schema] : schemas_) sorted[name] = std::move(schema);
    return sorted;
  }

 private:
  Result<void> add(const std::string& name) {
    if (schemas_.contains(name)) return {};
    const auto found = std::ranges::find(all_, name, &described::Schemas::value_type::first);
    if (found == all_.end()) return fail(Fault::internal, name, "there is no schema of this name");
    ordered_json schema = found->second;
    schemas_.emplace(name, ordered_json());  // ends recursion between schemas that refer to each other
    TRY(rebase(schema, name));
    schemas_[name] = std::move(schema);
    return {};
  }

  // References to other schemas (NAME.schema.json) and within this one (#/...) become those of the document.
  Result<void> rebase(ordered_json& node, const std::string& name) {
    if (!node.is_structured()) return {};
    for (auto& [key, value] : node.items()) {
      if (key != "$ref" || !value.is_string()) {
        TRY(rebase(value, name));
        continue;
      }
      std::string target = value.get<std::string>();
      if (target.ends_with(suffix)) {
        target.resize(target.size() - suffix.size());
        TRY(add(target));
      } else {
        target.replace(0, 1, name);
      }
      value = prefix_ + target;
    }
    return {};
  }

  static inline const std::string prefix_ = "#/components/schemas/";
  const described::Schemas& all_;
  std::map<std::string, ordered_json> schemas_;
};

ordered_json parameter_of(const Parameter& parameter) {
  static constexpr const char* types[] = {"string", "integer", "number", "boolean"};
  ordered_json schema{{"type", types[static_cast<std::size_t>(parameter.type)]}};
  const auto bound = [&](double value) {
    const bool whole = parameter.type == Parameter::Type::integer;
    return whole ? ordered_json(static_cast<std::int64_t>(value)) : ordered_json(value);
  };
  if (parameter.minimum) schema["minimum"] = bound(*parameter.minimum);
  if (parameter.maximum) schema["maximum"] = bound(*parameter.maximum);
  if (parameter.usual) schema["default"] = bound(*parameter.usual);
  if (!parameter.choices.empty()) schema["enum"] = parameter.choices;
  return {{"name", parameter.name},
          {"in", "query"},
          {"required", parameter.required},
          {"description", parameter.description},
          {"schema", std::move(schema)}};
}

// The errors of the frame for an endpoint, and those that the endpoint declares.
std::set<unsigned> errors_of(const Endpoint& endpoint) {
  std::set<unsigned> statuses(endpoint.error_statuses.begin(), endpoint.error_statuses.end());
  statuses.insert({400, 406, 421, 500});
  if (endpoint.role != Role::open) statuses.insert({401, 403});
  if (endpoint.method != Method::get) statuses.insert(403);
  if (!endpoint.parameters.empty() || takes_idempotency_key(endpoint)) statuses.insert(422);
  if (!endpoint.request_schema.empty()) statuses.insert({413, 415, 422});
  if (endpoint.run != Run::io || !endpoint.request_schema.empty()) statuses.insert({429, 503});
  return statuses;
}

// The role is listed with each security scheme: OpenAPI 3.1 allows them also without OAuth2.
ordered_json security_of(Role role) {
  if (role == Role::open) return ordered_json::array();
  const ordered_json roles = ordered_json::array({access::name(role)});
  return ordered_json::array({{{"bearer", roles}}, {{"session", roles}}});
}

Endpoint self_endpoint(std::shared_ptr<const Asset> document) {
  return {.path = "/openapi.json",
          .operation_id = "getOpenApi",
          .role = Role::read,
          .tag = "operations",
          .summary = "This description of the interface, OpenAPI 3.1",
          .response_schema = "openapi",
          .run = Run::io,
          .handler = [document = std::move(document)](const Request& request) -> Result<Response> {
            return document->answer(request);
          }};
}

// Groups of endpoints, in the order of the document.
constexpr std::pair<std::string_view, std::string_view> tag_table[] = {
    {"robots", "The fleet: robots, their models in force and their live states"},
    {"planning", "For schedulers: profiles, estimates, autonomy, energy matrices"},
    {"missions", "The history: missions, their ledgers, traces and telemetry"},
    {"maps", "Floor plans, and where robots drive"},
    {"models", "Versions of robots' models: compare, propose, adopt, reinstate"},
    {"diagnosis", "Why a robot departs from its model"},
    {"events", "Events, live as server-sent events and as the event log"},
    {"access", "Sign-in, where the service has tokens"},
    {"operations", "State of the service"},
};

std::string_view description_of_tag(std::string_view tag) {
  for (const auto& [name, description] : tag_table)
    if (name == tag) return description;
  return {};
}

// The meaning of a segment of a path; of an {id} by the list that contains it.
std::string_view description_of(std::string_view segment, std::string_view path) {
  if (segment == "{map}") return "name of the map, 1 to 47 of A-Z a-z 0-9 . _ -";
  if (segment == "{version}") return "number of the version: `model_version` in the list of models";
  if (segment == "{level}") return "name of the level on the map, of the same characters";
  if (path.starts_with("/v1/robots/")) return "the robot's id, as in its telemetry";
  if (path.starts_with("/v1/missions/")) return "number of the mission: `id` in the list of missions";
  if (path.starts_with("/v1/diagnoses/")) return "number of the diagnosis: `id` in the list of diagnoses";
  return {};
}

Result<ordered_json> parameters_of(const Endpoint& endpoint) {
  ordered_json parameters = ordered_json::array();
  const auto target = parse_target(endpoint.path);
  if (!target) return fail(Fault::internal, endpoint.path, "malformed path template");
  for (const std::string& segment : target->segments) {
    if (segment.size() < 3 || segment.front() != '{') continue;
    parameters.push_back({{"name", segment.substr(1, segment.size() - 2)},
                          {"in", "path"},
                          {"required", true},
                          {"description", description_of(segment, endpoint.path)},
                          {"schema", {{"type", "string"}, {"minLength", 1}}}});
  }
  for (const Parameter& parameter : endpoint.parameters) parameters.push_back(parameter_of(parameter));
  if (takes_idempotency_key(endpoint))
    parameters.push_back(
        {{"name", idempotency_header},
         {"in", "header"},
         {"required", false},
         {"description",
          "chosen by the client, new for each new request: within 7 days a repetition of the "
          "request under the key is answered as the request was, with Idempotency-Replayed: "
          "true, and changes nothing"},
         {"schema", {{"type", "string"}, {"minLength", 1}, {"maxLength", longest_idempotency_key}}}});
  return parameters;
}

ordered_json information() {
  return {{"title", "joulecastd"},
          {"description",
           "Energy of a fleet of differential-drive robots: accounts, forecasts, savings. "
           "Names carry units; energy leaving a battery is positive; null is not measured."},
          {"license", {{"name", "MIT"}, {"identifier", "MIT"}}},
          {"version", JOULECAST_VERSION}};
}

ordered_json security_schemes() {
  return {{"bearer",
           {{"type", "http"},
            {"scheme", "bearer"},
            {"description",
             "A token, where the service has auth.token_file; roles: read < plan < operate < admin"}}},
          {"session",
           {{"type", "apiKey"},
            {"in", "cookie"},
            {"name", session_cookie},
            {"description", "Cookie that POST /v1/session gives a browser for a token"}}}};
}

// The contents of a document: the table's rows become paths one by one.
class Document {
 public:
  Document(const described::Schemas& schemas, std::span<const EmbeddedFile> examples)
      : components_(schemas), examples_(examples) {}

  Result<void> add(const Endpoint& endpoint) {
    if (endpoint.role == Role::unstated)
      return fail(Fault::internal, endpoint.operation_id, "the table states no role for it");
    if (description_of_tag(endpoint.tag).empty())
      return fail(Fault::internal, endpoint.operation_id, "has no tag that is described");
    ordered_json operation{{"operationId", endpoint.operation_id},
                           {"tags", ordered_json::array({endpoint.tag})},
                           {"summary", endpoint.summary},
                           {"security", security_of(endpoint.role)}};
    TRY_ASSIGN(ordered_json parameters, parameters_of(endpoint));
    if (!parameters.empty()) operation["parameters"] = std::move(parameters);
    if (!endpoint.request_schema.empty()) {
      TRY_ASSIGN(ordered_json content,
                 content_of(endpoint.request_schema, endpoint.operation_id + ".request.json"));
      operation["requestBody"] = {{"required", true},
                                  {"content", {{"application/json", std::move(content)}}}};
    }
    if (!endpoint.request_types.empty()) operation["requestBody"]["required"] = true;
    for (const std::string& type : endpoint.request_types)
      operation["requestBody"]["content"][type] = ordered_json::object();
    TRY_ASSIGN(ordered_json success, success_of(endpoint));
    operation["responses"][std::to_string(endpoint.success_status)] = std::move(success);
    for (const unsigned status : errors_of(endpoint)) {
      operation["responses"][std::to_string(status)] = {
          {"$ref", "#/components/responses/problem_" + std::to_string(status)}};
      statuses_.insert(status);
    }
    tags_.insert(endpoint.tag);
    paths_[endpoint.path][lower_name(endpoint.method)] = std::move(operation);
    return {};
  }

  Result<std::string> text() {
    TRY_ASSIGN(const ordered_json problem_reference, components_.reference("problem"));
    ordered_json responses = ordered_json::object();
    for (const unsigned status : statuses_)
      responses["problem_" + std::to_string(status)] = {
          {"description", reason_phrase(status)},
          {"content", {{"application/problem+json", {{"schema", problem_reference}}}}}};
    ordered_json document;
    document["openapi"] = "3.1.0";
    document["info"] = information();
    document["servers"] =
        ordered_json::array({{{"url", "/"}, {"description", "The service that serves this document"}}});
    document["tags"] = ordered_json::array();
    for (const auto& [name, description] : tag_table)
      if (tags_.contains(std::string(name)))
        document["tags"].push_back({{"name", name}, {"description", description}});
    document["paths"] = std::move(paths_);
    document["components"] = {{"schemas", components_.take()},
                              {"responses", std::move(responses)},
                              {"securitySchemes", security_schemes()}};
    return document.dump(2) + "\n";
  }

 private:
  // {"schema": ..., "example": ...}: the example where schemas/examples has that file.
  Result<ordered_json> content_of(const std::string& schema, const std::string& example) {
    TRY_ASSIGN(ordered_json reference, components_.reference(schema));
    ordered_json content{{"schema", std::move(reference)}};
    const auto file = std::ranges::find(examples_, example, &EmbeddedFile::name);
    if (file == examples_.end()) return content;
    if (auto strict = parse_json(file->bytes); !strict)
      return fail(Fault::internal, example, describe(strict.error()));
    content["example"] = ordered_json::parse(file->bytes);
    return content;
  }

  Result<ordered_json> success_of(const Endpoint& endpoint) {
    ordered_json success{{"description", reason_phrase(endpoint.success_status)}};
    if (endpoint.success_status == 204) return success;
    ordered_json content{{"schema", {{"type", "string"}}}};
    if (!endpoint.response_schema.empty()) {
      TRY_ASSIGN(content, content_of(endpoint.response_schema, endpoint.operation_id + ".answer.json"));
    }
    if (!endpoint.events.empty()) {
      TRY_ASSIGN(content["schema"], events_of(endpoint));
    }
    success["content"][endpoint.response_type.substr(0, endpoint.response_type.find(';'))] =
        std::move(content);
    if (endpoint.csv) success["content"]["text/csv"] = {{"schema", {{"type", "string"}}}};
    return success;
  }

  // A stream of events as its text decodes: names, and the JSON of their data.
  Result<ordered_json> events_of(const Endpoint& endpoint) {
    ordered_json kinds = ordered_json::array();
    for (const EventKind& event : endpoint.events) {
      TRY_ASSIGN(ordered_json data, components_.reference(event.schema));
      kinds.push_back({{"type", "object"},
                       {"description", event.description},
                       {"properties", {{"event", {{"const", event.name}}}, {"data", std::move(data)}}},
                       {"required", {"event", "data"}}});
    }
    return ordered_json{{"type", "string"},
                        {"contentMediaType", "text/event-stream"},
                        {"contentSchema", {{"type", "array"}, {"items", {{"oneOf", std::move(kinds)}}}}}};
  }

  Components components_;
  std::span<const EmbeddedFile> examples_;
  ordered_json paths_ = ordered_json::object();
  std::set<std::string> tags_;
  std::set<unsigned> statuses_;
};

}  // namespace

described::Schema openapi_schema() {
  const auto member = [](const char* type, const char* words) {
    return described::with_words(described::of_type(type), words);
  };
  described::Schema version = member("string", "version of OpenAPI");
  version["pattern"] = R"(^3\.1\.)";
  return described::of_object("An OpenAPI 3.1 document", {},
                              {{"openapi", std::move(version)},
                               {"info", member("object", "name and version of the service")},
                               {"servers", member("array", "where the service is")},
                               {"tags", member("array", "groups of endpoints")},
                               {"paths", member("object", "the endpoints")},
                               {"components", member("object", "schemas, problems and ways to sign in")}});
}

Result<std::string> openapi_document(std::span<const Endpoint> given, const described::Schemas& schemas,
                                     std::span<const EmbeddedFile> examples) {
  std::vector<Endpoint> endpoints(given.begin(), given.end());
  endpoints.push_back(self_endpoint(nullptr));
  Document document(schemas, examples);
  for (const Endpoint& endpoint : endpoints)
    if (endpoint.documented) TRY(document.add(endpoint));
  return document.text();
}

Result<std::vector<Endpoint>> with_openapi(std::vector<Endpoint> endpoints, const described::Schemas& schemas,
                                           std::span<const EmbeddedFile> examples) {
  TRY_ASSIGN(std::string document, openapi_document(endpoints, schemas, examples));
  endpoints.push_back(
      self_endpoint(std::make_shared<const Asset>(std::move(document), "application/json", "no-cache")));
  return endpoints;
}

}  // namespace joulecast::http
