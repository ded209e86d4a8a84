#include "history/audit.h"

#include <limits>

#include "access/sha256.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "history/open_store.h"
#include "history/sql_queries.h"
#include "history/store.h"

namespace joulecast::history {
namespace {

constexpr std::string_view audit_columns =
    "audit_id, utime_us, actor, address, request_id, action, detail_json, hash";
const std::string before_the_first(64, '0');

AuditEntry read_entry(Rows& rows) {
  AuditEntry entry;
  entry.id = rows.integer();
  entry.utime_us = rows.integer();
  for (std::string* text :
       {&entry.actor, &entry.address, &entry.request_id, &entry.action, &entry.detail_json, &entry.hash})
    *text = rows.text();
  return entry;
}

}  // namespace

std::string audit_hash(std::string_view previous_hash, const AuditEntry& entry) {
  std::string text;
  const auto add = [&text](std::string_view member) {
    text.append(std::to_string(member.size())).append(":").append(member).append(",");
  };
  add(previous_hash);
  add(std::to_string(entry.id));
  add(std::to_string(entry.utime_us));
  for (const std::string* member :
       {&entry.actor, &entry.address, &entry.request_id, &entry.action, &entry.detail_json})
    add(*member);
  return access::sha256_hex(text);
}

std::int64_t append_audit(Database& database, AuditEntry entry) {
  std::string previous = before_the_first;
  entry.id = 1;
  {
    Rows last(database.statement("SELECT audit_id + 1, hash FROM audit ORDER BY audit_id DESC LIMIT 1"));
    if (last.next()) {
      entry.id = last.integer();
      previous = last.text();
    }
  }
  entry.hash = audit_hash(previous, entry);
  Rows(database.statement("INSERT INTO audit (" + std::string(audit_columns) +
                          ") VALUES (?, ?, ?, ?, ?, ?, ?, ?)"))
      .bind(entry.id)
      .bind(entry.utime_us)
      .bind(entry.actor)
      .bind(entry.address)
      .bind(entry.request_id)
      .bind(entry.action)
      .bind(entry.detail_json)
      .bind(entry.hash)
      .run();
  return entry.id;
}

Result<std::vector<AuditEntry>> read_audit(Database& database, std::int64_t before_id, std::int64_t limit) {
  TRY(queries::check_limit("limit", limit, max_page_size));
  std::vector<AuditEntry> entries;
  Rows rows(database.statement("SELECT " + std::string(audit_columns) +
                               " FROM audit WHERE audit_id < ? ORDER BY audit_id DESC LIMIT ?"));
  rows.bind(before_id).bind(limit);
  while (rows.next()) entries.push_back(read_entry(rows));
  return entries;
}

Result<AuditState> verify_audit(Database& database, const std::string& where, std::string_view seen_head,
                                const std::function<void(const AuditEntry&)>& each) {
  if (!database.has_table("audit"))
    return fail(Fault::corrupt, where,
                "has no audit; a store made by an earlier version gets one when it is next opened");
  AuditState state;
  bool seen = seen_head.empty();
  std::string previous = before_the_first;
  // Read in batches: a database may keep a query's result in memory.
  constexpr std::int64_t at_once = 1000;
  std::int64_t next = std::numeric_limits<std::int64_t>::min();  // an entry of this number is one, too
  for (std::int64_t got = at_once; got == at_once;) {
    Rows rows(database.statement("SELECT " + std::string(audit_columns) +
                                 " FROM audit WHERE audit_id >= ? ORDER BY audit_id LIMIT ?"));
    rows.bind(next).bind(at_once);
    for (got = 0; rows.next(); ++got) {
      const AuditEntry entry = read_entry(rows);
      const std::int64_t expected = state.entries + 1;
      if (entry.id != expected || entry.hash != audit_hash(previous, entry))
        return fail(
            Fault::corrupt, where,
            "the audit is broken at entry " + std::to_string(expected) +
                (entry.id != expected ? ", which is missing"
                                      : " of " + utc_text(entry.utime_us) + ": it or its hash was changed"));
      previous = entry.hash;
      next = entry.id + 1;
      seen = seen || entry.hash == seen_head;
      ++state.entries;
      if (each) each(entry);
    }
  }
  if (state.entries > 0) state.head = previous;
  if (!seen)
    return fail(Fault::corrupt, where,
                "no entry has the hash " + std::string(seen_head) + ": the audit was truncated or recreated");
  return state;
}

Result<AuditState> verify_audit(const std::string& store_url, std::string_view seen_head,
                                const std::function<void(const AuditEntry&)>& each) {
  const std::string shown = shown_url(store_url);
  const auto database = open_to_read(store_url);
  if (!database) return fail(database.error().fault, shown, database.error().message);
  try {
    Transaction snapshot(**database, Database::Access::read);
    return verify_audit(**database, shown, seen_head, each);
  } catch (const SqlError& error) {
    return fail(error.fault(), shown, error.what());
  }
}

}  // namespace joulecast::history
