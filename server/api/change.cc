#include "server/api/change.h"

#include <utility>

#include "server/http/gate.h"

namespace joulecast::api {

history::RequestAnswer stored_answer(http::IdempotencyKeys::Answer answer, std::int64_t utime_us) {
  return {std::move(answer.actor), std::move(answer.key),      std::move(answer.fingerprint), utime_us,
          answer.status,           std::move(answer.location), std::move(answer.body)};
}

history::Change RequestChange::answered_by(Answer answer) {
  response_ = std::make_shared<std::optional<http::Response>>();
  const std::int64_t now = services_.now_utime_us();
  const http::Kept& kept = request_.kept;
  history::Change change;
  if (!kept.idempotency_key.empty()) change.key = stored_answer(http::answer_of(request_, {}), now);
  history::AuditEntry entry{0, now, request_.actor, request_.address, request_.id, kept.audit_action, {}, {}};
  change.follow = [response = response_, answer = std::move(answer), key = change.key,
                   entry = std::move(entry)](std::int64_t outcome) mutable {
    *response = answer(outcome);
    std::vector<history::Command> commands;
    if (!entry.action.empty()) {
      entry.detail_json = http::audited_status((*response)->status);
      commands.emplace_back(history::AppendAudit{entry});
    }
    if (key) {
      key->status = (*response)->status;
      key->location = http::location_of(**response);
      key->body = (*response)->body;
      commands.emplace_back(history::KeepAnswer{*key});
    }
    return commands;
  };
  return change;
}

Result<http::Response> RequestChange::finish(Result<void> committed) {
  if (!committed) {
    Error& why = committed.error();
    if (why.field == history::Change::key_field) why.field = http::idempotency_header;
    return tl::unexpected(std::move(why));
  }
  request_.kept.committed = true;
  return std::move(**response_);
}

}  // namespace joulecast::api
