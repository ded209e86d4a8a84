#include "server/http/gate.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "access/sha256.h"
#include "base/json_number.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "describe/input.h"
#include "describe/table.h"
#include "server/http/problem.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

using access::Token;
using nlohmann::ordered_json;

constexpr std::int64_t microseconds_per_s = 1'000'000;
constexpr std::int64_t session_s = 12 * 3600;
constexpr std::size_t most_sessions_of_a_token = 100;
constexpr std::int64_t audited_per_minute = 60;  // refusals of all clients, sign-ins of a token
constexpr std::size_t longest_text = 256;        // of a secret, or of a client's text in the audit
constexpr std::string_view robot_path = "/v1/robots/{id}";

// The value of a cookie of that name, or empty.
std::string_view cookie_value(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    std::string_view pair = trimmed(take_item(header, ';'));
    if (pair.size() > name.size() && take_item(pair, '=') == name) return pair;
  }
  return {};
}

// The robots that a request is about by its path or query; empty: all.
std::vector<std::string> robots_of(const Endpoint& endpoint, const Request& request) {
  const std::string_view path = endpoint.path;
  if (path.starts_with(robot_path) && (path.size() == robot_path.size() || path[robot_path.size()] == '/'))
    return {request.param("id")};
  return listed(request.query_value("robot_id").value_or(std::string_view{}));
}

const auto token_table =
    described::Table<Token>("Token of the session")
        .value("name", AT(name), "name of the token")
        .word(
            "role", [](const Token& t) { return access::name(t.role); },
            std::array{"read", "plan", "operate", "admin"}, "permissions of the token")
        .text_or_null("robots", AT(robots), "shell pattern of the permitted robot ids; null: all")
        .value("expires",
               [](const Token& t) {
                 return t.expires_utime_us == 0 ? std::nullopt : std::optional(utc_text(t.expires_utime_us));
               },
               "end of the token, which ends its sessions; null: none", {{"format", "date-time"}});

const auto session_input =
    described::Input<std::string>("Start of a session")
        .text("token", std::identity(), longest_text, "token as printed by joulecast token create");

AccessEvent token_event(std::string action, const Token& token) {
  ordered_json detail = token_table.document(token);
  // Enough to distinguish two tokens of one name.
  detail["sha256_begins"] = token.sha256.substr(0, 16);
  return {.action = std::move(action), .detail_json = detail.dump()};
}

// The beginning of a client's text, without secrets of tokens.
std::string auditable(std::string text) {
  for (auto at = text.find(access::secret_prefix); at != std::string::npos;
       at = text.find(access::secret_prefix, at)) {
    at += access::secret_prefix.size();
    text.erase(at, text.find_first_not_of("0123456789abcdefABCDEF", at) - at);
    text.insert(at, "...");
  }
  if (text.size() > longest_text) text.replace(longest_text, std::string::npos, "...");
  return text;
}

// A request as recorded in the audit; never with its headers.
ordered_json wanted(const Request& request) {
  ordered_json detail{{"method", to_string(request.method)}, {"path", auditable(request.path)}};
  std::size_t bytes = 0;
  for (const auto& [key, value] : request.query) {
    if ((bytes += key.size() + std::min(value.size(), longest_text)) > 2 * longest_text) break;
    detail["query"][auditable(key)] = auditable(value);
  }
  return detail;
}

// `presented`: a token that is not in force, else none.
Response unauthorized(const Request& request, bool presented, std::string_view detail, std::string_view field,
                      std::string_view constraint) {
  Response response = problem(401, "unauthorized", detail, request.id, field, constraint);
  response.headers.emplace_back("WWW-Authenticate", std::string(R"(Bearer realm="joulecast")") +
                                                        (presented ? R"(, error="invalid_token")" : ""));
  return response;
}

}  // namespace

Result<std::unique_ptr<Gate>> Gate::open(Options options) {
  auto gate = std::unique_ptr<Gate>(new Gate(std::move(options)));
  if (!gate->enabled()) return gate;
  gate->stamp_ = access::stamp_of(gate->options_.token_file);
  if (Result<void> loaded = gate->load(); !loaded) {
    const bool there = ::access(gate->options_.token_file.c_str(), F_OK) == 0;
    return fail(loaded.error().fault, "auth.token_file",
                describe(loaded.error()) + (!there ? "; joulecast token create makes it"
                                            : loaded.error().fault == Fault::invalid
                                                ? ""
                                                : "; the daemon's user must be able to read it"));
  }
  return gate;
}

// With the mutex locked, or before other threads exist.
Result<void> Gate::load() {
  TRY_ASSIGN(std::vector<Token> read, access::read_tokens(options_.token_file));
  const auto holds = [](const std::vector<Token>& list, const Token& token) {
    return std::ranges::find(list, token) != list.end();
  };
  for (const Token& token : tokens_)
    if (!holds(read, token)) record(token_event("token_removed", token));
  for (const Token& token : read)
    if (!holds(tokens_, token)) record(token_event("token_in_force", token));
  tokens_ = std::move(read);
  return {};
}

void Gate::refresh() {
  if (!enabled()) return;
  const std::lock_guard lock(mutex_);
  const access::FileStamp now = access::stamp_of(options_.token_file);
  if (now == stamp_) return;
  stamp_ = now;
  file_ = load();
}

Result<void> Gate::check() const {
  const std::lock_guard lock(mutex_);
  if (!file_)
    return fail(Fault::unavailable, "auth.token_file",
                "cannot be read; the previous tokens stay in force: " + describe(file_.error()));
  return {};
}

// For an event that has happened and cannot be undone.
void Gate::record(const AccessEvent& event) {
  if (!options_.audit) return;
  if (const Result<void> kept = options_.audit(event); !kept && options_.not_audited)
    options_.not_audited(event, kept.error());
}

void Gate::begin_minute() {
  const std::int64_t minute = options_.now_utime_us() / (60 * microseconds_per_s);
  if (minute == minute_) return;
  if (refusals_omitted_ > 0)
    record(
        {.action = "refusals_omitted", .detail_json = json_text(ordered_json{{"count", refusals_omitted_}})});
  minute_ = minute;
  refusals_ = refusals_omitted_ = 0;
  refusals_of_.clear();
  sign_ins_of_.clear();
}

// A refused client may repeat its request without limit: a minute's further refusals are counted, not listed.
// One address has a quarter of the list.
void Gate::record_refusal(const Endpoint& endpoint, const Request& request, unsigned status) {
  begin_minute();
  if (refusals_ >= audited_per_minute || refusals_of_[request.address] >= audited_per_minute / 4) {
    ++refusals_omitted_;
    return;
  }
  ++refusals_;
  ++refusals_of_[request.address];
  ordered_json detail = wanted(request);
  detail["status"] = status;
  record({request.actor, request.address, request.id, endpoint.operation_id, json_text(detail)});
}

// The token that a request proves to have; null: none that is valid. With the mutex held.
const Token* Gate::token_of(const Request& request, bool& presented) {
  const std::int64_t now = options_.now_utime_us();
  const std::string_view authorization = trimmed(request.header("authorization"));
  const Token* token = nullptr;
  if (!authorization.empty()) {
    presented = true;
    constexpr std::string_view scheme = "bearer ";
    if (authorization.size() <= scheme.size() || authorization.size() > longest_text ||
        !equals_ignoring_case(authorization.substr(0, scheme.size()), scheme))
      return nullptr;
    token = access::find_token(tokens_, trimmed(authorization.substr(scheme.size())));
  } else if (const auto value = cookie_value(request.header("cookie"), session_cookie); !value.empty()) {
    presented = true;
    const auto session = sessions_.find(access::sha256_hex(value));
    if (session == sessions_.end()) return nullptr;
    const auto begun = std::ranges::find(tokens_, session->second.token_sha256, &Token::sha256);
    if (begun == tokens_.end() || now >= session->second.expires_utime_us) {
      sessions_.erase(session);
      return nullptr;
    }
    token = &*begun;
  }
  return token != nullptr && !access::has_expired(*token, now) ? token : nullptr;
}

std::optional<std::string> Gate::why_not(const Token& token, const Endpoint& endpoint,
                                         const Request& request) const {
  if (token.role < endpoint.role)
    return "This needs a token of role " + std::string(access::name(endpoint.role)) + "; " + token.name +
           " has role " + std::string(access::name(token.role));
  if (token.robots.empty()) return std::nullopt;
  const std::vector<std::string> robots = robots_of(endpoint, request);
  if (robots.empty()) return "This needs a token for all robots; " + token.name + " is for " + token.robots;
  // One entry each: a pattern that begins one name would match a list of names.
  for (const std::string& robot : robots)
    if (!access::is_for_robot(token, robot))
      return token.name + " is for the robots " + token.robots + " alone";
  return std::nullopt;
}

std::optional<Response> Gate::refuse(const Endpoint& endpoint, Request& request) {
  if (!enabled() || endpoint.role == Role::open) return std::nullopt;
  refresh();
  const std::lock_guard lock(mutex_);
  bool presented = false;
  const Token* token = token_of(request, presented);
  if (token == nullptr) {
    record_refusal(endpoint, request, 401);
    return unauthorized(
        request, presented,
        presented ? "The token or session is unknown, expired or revoked"
                  : "This needs a token: Authorization: Bearer TOKEN, or a session of POST /v1/session",
        "Authorization", "must be a bearer token that is in force");
  }
  request.actor = token->name;
  if (const auto why = why_not(*token, endpoint, request)) {
    record_refusal(endpoint, request, 403);
    const bool lacks_role = token->role < endpoint.role;
    return problem(403, "forbidden", *why, request.id, "Authorization",
                   lacks_role
                       ? "must be a token of role " + std::string(access::name(endpoint.role)) + " for this"
                       : "must be a token for the requested robots");
  }
  return std::nullopt;
}

Endpoint Gate::audited(Endpoint endpoint) {
  if (endpoint.role != Role::operate && endpoint.role != Role::admin) return endpoint;
  endpoint.handler = [this, inner = std::move(endpoint.handler),
                      action = endpoint.operation_id](const Request& request) -> Result<Response> {
    const auto event = [&](const ordered_json& detail) {
      return AccessEvent{request.actor, request.address, request.id, action, json_text(detail)};
    };
    ordered_json asked = wanted(request);
    if (!request.body.empty()) asked["body_sha256"] = access::sha256_hex(request.body);
    // Records are committed in their order: this one before the change.
    if (const Result<void> kept = options_.audit ? options_.audit(event(asked)) : Result<void>(); !kept)
      return fail(Fault::unavailable, "", "the audit cannot be kept: " + describe(kept.error()));
    try {
      request.kept.audit_action = action;
      Result<Response> response = inner(request);
      if (!request.kept.committed)
        record(event({{"status", response ? response->status : status_of(response.error().fault)}}));
      return response;
    } catch (...) {
      record(event({{"status", 500}}));
      throw;
    }
  };
  return endpoint;
}

std::string audited_status(unsigned status) {
  return json_text(ordered_json{{"status", status}});
}

std::string Gate::cookie(std::string_view value, std::int64_t max_age_s, bool secure) {
  return std::string(session_cookie) + "=" + std::string(value) +
         "; Path=/; Max-Age=" + std::to_string(max_age_s) + "; HttpOnly; SameSite=Strict" +
         (secure ? "; Secure" : "");
}

Result<Response> Gate::sign_in(const Request& request) {
  TRY_ASSIGN(const std::string secret, session_input.read(*request.json));
  if (!enabled())
    return fail(Fault::conflict, "/token", "this service has no tokens: signing in is not required");
  refresh();
  const std::lock_guard lock(mutex_);
  const std::int64_t now = options_.now_utime_us();
  const Token* token = access::find_token(tokens_, secret);
  Endpoint here;
  here.operation_id = "createSession";
  if (token == nullptr || access::has_expired(*token, now)) {
    record_refusal(here, request, 401);
    return unauthorized(request, true, "The token is unknown, expired or revoked", "/token",
                        "must be a token that is in force");
  }
  begin_minute();
  if (++sign_ins_of_[token->sha256] > audited_per_minute)
    return problem(429, "too-many-requests", "This token has signed in too often within a minute",
                   request.id);
  std::erase_if(sessions_, [now](const auto& each) { return each.second.expires_utime_us <= now; });
  const auto is_own = [&](const auto& each) { return each.second.token_sha256 == token->sha256; };
  if (std::ranges::count_if(sessions_, is_own) >= std::ptrdiff_t{most_sessions_of_a_token}) {
    const auto sooner = [&](const auto& a, const auto& b) {
      return std::pair(!is_own(a), a.second.expires_utime_us) <
             std::pair(!is_own(b), b.second.expires_utime_us);
    };
    sessions_.erase(std::ranges::min_element(sessions_, sooner));
  }
  const std::string value = access::random_hex(32);
  sessions_[access::sha256_hex(value)] = {token->sha256, now + session_s * microseconds_per_s};
  record({token->name, request.address, request.id, here.operation_id, audited_status(200)});
  Response response = json_response(token_table.text(*token));
  response.headers.emplace_back("Set-Cookie", cookie(value, session_s, request.secure));
  return response;
}

Result<Response> Gate::sign_out(const Request& request) {
  {
    const std::lock_guard lock(mutex_);
    bool presented = false;
    const Token* token = token_of(request, presented);
    const std::string value = access::sha256_hex(cookie_value(request.header("cookie"), session_cookie));
    if (sessions_.erase(value) > 0 && token != nullptr)
      record({token->name, request.address, request.id, "deleteSession", audited_status(204)});
  }
  Response response;
  response.status = 204;
  response.content_type.clear();
  response.headers.emplace_back("Set-Cookie", cookie("", 0, request.secure));
  return response;
}

described::Schemas session_schemas() {
  return {{"session", token_table.schema()}, {"session-request", session_input.schema()}};
}

std::vector<Endpoint> Gate::session_endpoints() {
  return {{.method = Method::post,
           .path = "/v1/session",
           .operation_id = "createSession",
           .role = Role::open,
           .tag = "access",
           .summary = "Signs a browser in: a session cookie for a token, for 12 h or until it is revoked",
           .request_schema = "session-request",
           .max_body_bytes = 4096,
           .response_schema = "session",
           .error_statuses = {401, 409, 429},
           .run = Run::io,
           .handler = [this](const Request& request) { return sign_in(request); }},
          {.method = Method::del,
           .path = "/v1/session",
           .operation_id = "deleteSession",
           .role = Role::open,
           .tag = "access",
           .summary = "Signs the browser out, where it is signed in",
           .success_status = 204,
           .run = Run::io,
           .handler = [this](const Request& request) { return sign_out(request); }}};
}

}  // namespace joulecast::http
