#include "server/api/change.h"

#include <utility>

#include "server/api/idempotency.h"
#include "server/http/gate.h"

namespace joulecast::api {

history::Change RequestChange::answered_by(Answer answer) {
  response_ = std::make_shared<std::optional<http::Response>>();
  const std::int64_t now = services_.now_utime_us();
  const http::Kept& kept = request_.kept;
  history::Change change;
  if (!kept.idempotency_key.empty()) {
    change.key = key_of(request_);
    change.key->utime_us = now;
  }
  history::AuditEntry entry{0, now, request_.actor, request_.address, request_.id, kept.audit_action, {}, {}};
  change.follow = [response = response_, answer = std::move(answer), key = change.key,
                   entry = std::move(entry)](std::int64_t outcome) mutable {
    *response = answer(outcome);
    std::vector<history::Command> commands;
    if (!entry.action.empty()) {
      entry.detail_json = http::audited_status((*response)->status);
      commands.emplace_back(history::AppendAudit{entry});
    }
    if (key) commands.emplace_back(history::KeepAnswer{answer_under(*key, **response)});
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
