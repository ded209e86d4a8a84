#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "access/secret_file.h"
#include "access/token.h"
#include "describe/schema.h"
#include "server/http/router.h"

namespace joulecast::http {

inline constexpr std::string_view session_cookie = "joulecast_session";

// An event for the audit: a change, a refusal, a change of the tokens.
struct AccessEvent {
  std::string actor = {};  // name of a token; empty: anonymous
  std::string address = {};
  std::string request_id = {};
  std::string action = {};  // operation id, or "token_in_force", "token_removed", "refusals_omitted"
  std::string detail_json = {};
};

// The detail of the entry of an answer.
std::string audited_status(unsigned status);

// Access control. With a token file every request needs the role of its endpoint, by a bearer token or by the
// cookie of a session that a token began; without one every client may use every endpoint. The file is read
// again when it has changed; one that cannot be read leaves the tokens as they were and is reported by
// check(). Any thread.
class Gate {
 public:
  struct Options {
    std::string token_file = {};  // empty: no tokens
    std::function<std::int64_t()> now_utime_us = {};
    // Keeps an event; an error means that it is not and will not be kept. Must not block.
    std::function<Result<void>(AccessEvent)> audit = {};
    // Called with an event that happened and that `audit` failed to store; any thread. Empty: not reported.
    std::function<void(const AccessEvent&, const Error&)> not_audited = {};
  };

  // The file must be readable once.
  static Result<std::unique_ptr<Gate>> open(Options options);

  // Router::Guard: the answer 401 or 403 to a request that may not be made, else nothing and its actor.
  std::optional<Response> refuse(const Endpoint& endpoint, Request& request);

  // The same endpoint where its role changes something (operate, admin): it is audited before it is handled
  // and again with its answer, and not done where the audit cannot be kept.
  Endpoint audited(Endpoint endpoint);

  // POST and DELETE /v1/session.
  std::vector<Endpoint> session_endpoints();

  // Reads the token file again if it has changed.
  void refresh();
  // Whether the tokens in force are those of the file.
  Result<void> check() const;

 private:
  struct Session {
    std::string token_sha256;
    std::int64_t expires_utime_us = 0;
  };

  explicit Gate(Options options) : options_(std::move(options)) {}
  bool enabled() const { return !options_.token_file.empty(); }
  Result<void> load();
  const access::Token* token_of(const Request& request, bool& presented);
  std::optional<std::string> why_not(const access::Token& token, const Endpoint& endpoint,
                                     const Request& request) const;
  void record(const AccessEvent& event);
  void begin_minute();
  void record_refusal(const Endpoint& endpoint, const Request& request, unsigned status);
  Result<Response> sign_in(const Request& request);
  Result<Response> sign_out(const Request& request);
  // One of `secure` is sent over HTTPS alone.
  static std::string cookie(std::string_view value, std::int64_t max_age_s, bool secure);

  const Options options_;
  mutable std::mutex mutex_;
  std::vector<access::Token> tokens_;
  access::FileStamp stamp_;
  Result<void> file_;                                 // why the file in its present form is not in force
  std::map<std::string, Session> sessions_;           // by the hash of the cookie's value
  std::int64_t minute_ = 0;                           // since 1970
  std::int64_t refusals_ = 0, refusals_omitted_ = 0;  // in that minute
  std::map<std::string, std::int64_t> refusals_of_;   // by address
  std::map<std::string, std::int64_t> sign_ins_of_;   // by hash of the token
};

described::Schemas session_schemas();

}  // namespace joulecast::http
