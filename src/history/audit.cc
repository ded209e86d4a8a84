#include "history/audit.h"

#include <filesystem>

#include "access/sha256.h"
#include "base/utc_time.h"
#include "history/schema.h"

namespace joulecast::history {
namespace {

constexpr std::int64_t busy_timeout_ms = 2000;
constexpr std::string_view columns =
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

Result<AuditState> follow(Database& database, const std::string& path, std::string_view seen_head,
                          const std::function<void(const AuditEntry&)>& each) {
  if (database.integer("PRAGMA application_id") != store_application_id)
    return fail(Fault::corrupt, path, "is not a joulecast store");
  if (database.integer("SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = 'audit'") != 1)
    return fail(Fault::corrupt, path,
                "has no audit; a store made by an earlier version gets one when it is next opened");
  AuditState state;
  bool seen = seen_head.empty();
  std::string previous = before_the_first;
  Rows rows(database.statement("SELECT " + std::string(columns) + " FROM audit ORDER BY audit_id"));
  while (rows.next()) {
    AuditEntry entry = read_entry(rows);
    const std::int64_t expected = state.entries + 1;
    if (entry.id != expected || entry.hash != audit_hash(previous, entry))
      return fail(
          Fault::corrupt, path,
          "the audit is broken at entry " + std::to_string(expected) +
              (entry.id != expected ? ", which is missing"
                                    : " of " + utc_text(entry.utime_us) + ": it or its hash was changed"));
    previous = entry.hash;
    seen = seen || entry.hash == seen_head;
    ++state.entries;
    if (each) each(entry);
  }
  if (state.entries > 0) state.head = previous;
  if (!seen)
    return fail(Fault::corrupt, path,
                "no entry has the hash " + std::string(seen_head) + ": the audit was cut off or made anew");
  return state;
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
  Rows(database.statement("INSERT INTO audit (" + std::string(columns) + ") VALUES (?, ?, ?, ?, ?, ?, ?, ?)"))
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

Result<AuditState> verify_audit(const std::string& store_path, std::string_view seen_head,
                                const std::function<void(const AuditEntry&)>& each) {
  if (std::error_code error; !std::filesystem::exists(store_path, error))
    return fail(Fault::not_found, store_path, "does not exist");
  try {
    Database database(store_path, OpenMode::read_only, busy_timeout_ms);
    Transaction snapshot(database, Transaction::Kind::read);
    return follow(database, store_path, seen_head, each);
  } catch (const SqliteError& error) {
    return fail(error.fault(), store_path, error.what());
  }
}

}  // namespace joulecast::history
