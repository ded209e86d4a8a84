#include "server/http/openapi.h"

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/json_text.h"
#include "server/http/gate.h"
#include "server/http/problem.h"
#include "server/http/uri.h"

namespace joulecast::http {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
constexpr std::string_view suffix = ".schema.json";

std::string lower_name(Method method) {
  std::string name(to_string(method));
  std::transform(name.begin(), name.end(), name.begin(),
                 [](char c) { return static_cast<char>(c - 'A' + 'a'); });
  return name;
}

class Components {
 public:
  explicit Components(std::span<const EmbeddedFile> files) : files_(files) {}

  // {"$ref": ...} to the component of schemas/<name>.schema.json, which is taken in with all it refers to.
  Result<ordered_json> reference(const std::string& name) {
    if (auto added = add(name); !added) return tl::unexpected(added.error());
    return ordered_json{{"$ref", "#/components/schemas/" + name}};
  }
  ordered_json take() {
    ordered_json sorted = ordered_json::object();
    for (auto& [name, schema] : schemas_) sorted[name] = std::move(schema);
    return sorted;
  }

 private:
  Result<void> add(const std::string& name) {
    if (schemas_.contains(name)) return {};
    const auto file = std::find_if(files_.begin(), files_.end(), [&](const EmbeddedFile& each) {
      return each.name == name + std::string(suffix);
    });
    if (file == files_.end())
      return fail(Fault::internal, name, "there is no schemas/" + name + std::string(suffix));
    if (auto strict = parse_json(file->bytes); !strict) {
      return fail(Fault::internal, std::string(file->name), describe(strict.error()));
    }
    ordered_json schema = ordered_json::parse(file->bytes);  // keeps the file's order of keys
    // As components the schemas are parts of one document: their own identity would make references resolve
    // elsewhere.
    schema.erase("$schema");
    schema.erase("$id");
    schemas_.emplace(name, ordered_json());  // ends recursion between schemas that refer to each other
    if (auto done = rebase(schema, name); !done) return done;
    schemas_[name] = std::move(schema);
    return {};
  }

  // "#/$defs/x" -> "#/components/schemas/<name>/$defs/x"; "other.schema.json#/..." likewise under other.
  Result<void> rebase(ordered_json& node, const std::string& name) {
    if (node.is_array()) {
      for (auto& each : node) {
        if (auto done = rebase(each, name); !done) return done;
      }
      return {};
    }
    if (!node.is_object()) return {};
    for (auto& [key, value] : node.items()) {
      if (key != "$ref" || !value.is_string()) {
        if (auto done = rebase(value, name); !done) return done;
        continue;
      }
      const std::string reference = value.get<std::string>();
      const auto hash = reference.find('#');
      std::string file = reference.substr(0, hash);
      const std::string rest = hash == std::string::npos ? "" : reference.substr(hash + 1);
      if (!file.empty()) {
        if (!file.ends_with(suffix))
          return fail(Fault::internal, name, "cannot follow the reference " + reference);
        file.resize(file.size() - suffix.size());
        if (const auto slash = file.rfind('/'); slash != std::string::npos) file.erase(0, slash + 1);
        if (auto added = add(file); !added) return added;
      }
      value = "#/components/schemas/" + (file.empty() ? name : file) + rest;
    }
    return {};
  }

  std::span<const EmbeddedFile> files_;
  std::map<std::string, ordered_json> schemas_;
};

ordered_json parameter_of(const Parameter& parameter) {
  ordered_json schema;
  switch (parameter.type) {
    case Parameter::Type::text:
      schema["type"] = "string";
      break;
    case Parameter::Type::integer:
      schema["type"] = "integer";
      break;
    case Parameter::Type::number:
      schema["type"] = "number";
      break;
    case Parameter::Type::boolean:
      schema["type"] = "boolean";
      break;
  }
  const auto bound = [&](double value) {
    return parameter.type == Parameter::Type::integer ? ordered_json(static_cast<std::int64_t>(value))
                                                      : ordered_json(value);
  };
  if (parameter.minimum) schema["minimum"] = bound(*parameter.minimum);
  if (parameter.maximum) schema["maximum"] = bound(*parameter.maximum);
  if (!parameter.choices.empty()) schema["enum"] = parameter.choices;
  return {{"name", parameter.name},
          {"in", "query"},
          {"required", parameter.required},
          {"description", parameter.description},
          {"schema", std::move(schema)}};
}

// What the frame itself can answer for an endpoint, and what the endpoint declares.
std::set<unsigned> errors_of(const Endpoint& endpoint) {
  std::set<unsigned> statuses(endpoint.error_statuses.begin(), endpoint.error_statuses.end());
  statuses.insert({400, 406, 421, 500});
  if (endpoint.role != Role::open) statuses.insert({401, 403});
  if (endpoint.method != Method::get) statuses.insert(403);
  if (!endpoint.parameters.empty()) statuses.insert(422);
  if (!endpoint.request_schema.empty()) statuses.insert({413, 415, 422});
  if (endpoint.run != Run::io) statuses.insert({429, 503});
  return statuses;
}

// The role stands in the list of each way to prove it: OpenAPI 3.1 has roles there for schemes that are not
// OAuth2.
ordered_json security_of(Role role) {
  if (role == Role::open) return ordered_json::array();
  const ordered_json roles = ordered_json::array({access::name(role)});
  return ordered_json::array({{{"bearer", roles}}, {{"session", roles}}});
}

// The endpoint that serves the document.
Endpoint self_endpoint(std::shared_ptr<const std::string> text) {
  Endpoint self;
  self.path = "/openapi.json";
  self.operation_id = "getOpenApi";
  self.role = Role::read;
  self.summary = "This description of the interface, OpenAPI 3.1";
  self.run = Run::io;
  self.response_schema = "openapi";
  self.handler = [text = std::move(text)](const Request&) -> Result<Response> {
    Response response;
    response.shared_body = text;
    response.headers.emplace_back("Cache-Control", "no-cache");
    return response;
  };
  return self;
}

}  // namespace

Result<std::string> openapi_document(std::span<const Endpoint> given, std::span<const EmbeddedFile> schemas) {
  std::vector<Endpoint> endpoints(given.begin(), given.end());
  endpoints.push_back(self_endpoint(nullptr));
  Components components(schemas);
  ordered_json paths = ordered_json::object();
  std::set<unsigned> statuses;
  for (const Endpoint& endpoint : endpoints) {
    if (!endpoint.documented) continue;
    ordered_json operation;
    operation["operationId"] = endpoint.operation_id;
    operation["summary"] = endpoint.summary;
    if (endpoint.role == Role::unstated)
      return fail(Fault::internal, endpoint.operation_id, "the table states no role for it");
    operation["security"] = security_of(endpoint.role);
    ordered_json parameters = ordered_json::array();
    const auto target = parse_target(endpoint.path);
    if (!target) return fail(Fault::internal, endpoint.path, "malformed path template");
    for (const std::string& segment : target->segments) {
      if (segment.size() < 3 || segment.front() != '{') continue;
      parameters.push_back({{"name", segment.substr(1, segment.size() - 2)},
                            {"in", "path"},
                            {"required", true},
                            {"schema", {{"type", "string"}, {"minLength", 1}}}});
    }
    for (const Parameter& parameter : endpoint.parameters) parameters.push_back(parameter_of(parameter));
    if (!parameters.empty()) operation["parameters"] = std::move(parameters);
    if (!endpoint.request_schema.empty()) {
      auto schema = components.reference(endpoint.request_schema);
      if (!schema) return tl::unexpected(schema.error());
      operation["requestBody"] = {{"required", true},
                                  {"content", {{"application/json", {{"schema", *schema}}}}}};
    }
    ordered_json success;
    success["description"] = reason_phrase(endpoint.success_status);
    if (endpoint.success_status != 204) {
      ordered_json content;
      if (endpoint.response_schema.empty()) {
        content["schema"] = {{"type", "string"}};
      } else {
        auto schema = components.reference(endpoint.response_schema);
        if (!schema) return tl::unexpected(schema.error());
        content["schema"] = *schema;
      }
      success["content"][endpoint.response_type.substr(0, endpoint.response_type.find(';'))] =
          std::move(content);
      if (endpoint.csv) success["content"]["text/csv"] = {{"schema", {{"type", "string"}}}};
    }
    operation["responses"][std::to_string(endpoint.success_status)] = std::move(success);
    for (const unsigned status : errors_of(endpoint)) {
      operation["responses"][std::to_string(status)] = {
          {"$ref", "#/components/responses/problem_" + std::to_string(status)}};
      statuses.insert(status);
    }
    paths[endpoint.path][lower_name(endpoint.method)] = std::move(operation);
  }

  auto problem_reference = components.reference("problem");
  if (!problem_reference) return tl::unexpected(problem_reference.error());
  ordered_json responses = ordered_json::object();
  for (const unsigned status : statuses) {
    responses["problem_" + std::to_string(status)] = {
        {"description", reason_phrase(status)},
        {"content", {{"application/problem+json", {{"schema", *problem_reference}}}}}};
  }

  ordered_json document;
  document["openapi"] = "3.1.0";
  document["info"] = {{"title", "joulecastd"},
                      {"description",
                       "What a fleet of differential-drive robots spends, will spend and could save. "
                       "Names carry units; energy leaving a battery is positive; null is not measured."},
                      {"version", JOULECAST_VERSION}};
  document["paths"] = std::move(paths);
  document["components"] = {{"schemas", components.take()}, {"responses", std::move(responses)}};
  document["components"]["securitySchemes"] = {
      {"bearer",
       {{"type", "http"},
        {"scheme", "bearer"},
        {"description",
         "A token, where the service has auth.token_file; roles: read < plan < operate < admin"}}},
      {"session",
       {{"type", "apiKey"},
        {"in", "cookie"},
        {"name", session_cookie},
        {"description", "What POST /v1/session gives a browser for a token"}}}};
  return document.dump(2) + "\n";
}

Result<std::vector<Endpoint>> with_openapi(std::vector<Endpoint> endpoints,
                                           std::span<const EmbeddedFile> schemas) {
  auto document = openapi_document(endpoints, schemas);
  if (!document) return tl::unexpected(document.error());
  endpoints.push_back(self_endpoint(std::make_shared<const std::string>(std::move(*document))));
  return endpoints;
}

}  // namespace joulecast::http
