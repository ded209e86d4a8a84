#include "history/audit.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "access/sha256.h"
#include "base/json_writer.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "history/open_store.h"
#include "history/sql_rows.h"
#include "history/store.h"

namespace joulecast::history {
namespace {

const std::string before_the_first(64, '0');

constexpr std::string_view shortened = "audit_shortened";

// Of the last removed entry, as stated by the audit itself; that of a whole audit has number 0.
AuditEntry last_removed(Database& database) {
  AuditEntry last;
  last.hash = before_the_first;
  Rows rows(database,
            "SELECT audit_id, detail_json FROM audit WHERE action = ? ORDER BY audit_id DESC LIMIT 1",
            shortened);
  if (!rows.next()) return last;
  const std::int64_t stated_by = rows.integer();
  const nlohmann::json detail = nlohmann::json::parse(rows.text(), nullptr, false);
  if (!detail.is_object()) return last;
  const auto id = detail.find("last_id"), hash = detail.find("last_hash");
  if (id == detail.end() || !id->is_number_integer() || hash == detail.end() || !hash->is_string())
    return last;
  if (*id < 0 || *id >= stated_by) return last;
  last.id = *id;
  last.hash = *hash;
  return last;
}

// Verifies the links behind an entry, to one with a number or to the end; returns the last one.
Result<AuditEntry> follow_links(Database& database, const std::string& where, AuditEntry previous,
                                std::int64_t last_id, const std::function<void(const AuditEntry&)>& each) {
  // Read in batches: a database may keep a query's result in memory.
  constexpr std::int64_t at_once = 1000;
  std::int64_t next = std::numeric_limits<std::int64_t>::min();  // an entry of this number is one, too
  for (std::int64_t got = at_once; got == at_once;) {
    Rows rows(database,
              "SELECT " + columns_of<AuditEntry>() +
                  " FROM audit WHERE audit_id BETWEEN ? AND ? ORDER BY audit_id LIMIT ?",
              next, last_id, at_once);
    for (got = 0; rows.next(); ++got) {
      AuditEntry entry = *read_record<AuditEntry>(rows);
      const std::int64_t expected = previous.id + 1;
      if (entry.id != expected || entry.hash != audit_hash(previous.hash, entry))
        return fail(
            Fault::corrupt, where,
            "the audit is broken at entry " + std::to_string(expected) +
                (entry.id != expected ? ", which is missing"
                                      : " of " + utc_text(entry.utime_us) + ": it or its hash was changed"));
      next = entry.id + 1;
      if (each) each(entry);
      previous = std::move(entry);
    }
  }
  return previous;
}

// Removes entries, which a trigger forbids outside of this.
void remove_to(Database& database, std::int64_t last_id) {
  const auto remove = [&] { Rows(database, "DELETE FROM audit WHERE audit_id <= ?", last_id).run(); };
  if (database.is_postgres()) {
    database.execute("ALTER TABLE audit DISABLE TRIGGER audit_keeps_entries");
    remove();
    database.execute("ALTER TABLE audit ENABLE TRIGGER audit_keeps_entries");
    return;
  }
  const std::string trigger =
      database.text("SELECT sql FROM sqlite_schema WHERE type = 'trigger' AND name = 'audit_keeps_entries'");
  database.execute("DROP TRIGGER audit_keeps_entries");
  remove();
  database.execute(trigger);
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
    Rows last(database, "SELECT audit_id + 1, hash FROM audit ORDER BY audit_id DESC LIMIT 1");
    if (last.next()) read_values(last, entry.id, previous);
  }
  entry.hash = audit_hash(previous, entry);
  insert_record(database, "audit", entry);
  return entry.id;
}

Result<std::int64_t> shorten_audit(Database& database, std::int64_t before_utime_us, std::int64_t max_entries,
                                   std::int64_t now_utime_us) {
  std::int64_t kept_id = 0, first_id = 0;
  {
    Rows rows(database,
              "SELECT coalesce((SELECT audit_id FROM audit WHERE utime_us >= ? ORDER BY audit_id LIMIT 1), "
              "(SELECT max(audit_id) + 1 FROM audit), 0), coalesce((SELECT min(audit_id) FROM audit), 0)",
              before_utime_us);
    rows.next();
    read_values(rows, kept_id, first_id);
  }
  if (first_id >= kept_id) return 0;
  const AuditEntry before = last_removed(database);
  const std::int64_t last_id = std::min(kept_id - 1, before.id + max_entries);
  // A broken link stays to be found.
  TRY_ASSIGN(const AuditEntry last, follow_links(database, "audit", before, last_id, {}));
  const std::int64_t entries = last.id - before.id;
  JsonWriter detail;
  detail.begin_object().field("entries", entries).field("last_id", last.id).field("last_hash", last.hash);
  append_audit(database,
               {0, now_utime_us, "", "", "", std::string(shortened), detail.end_object().take(), ""});
  remove_to(database, last.id);
  return entries;
}

std::int64_t count_audit(Database& database) {
  return database.integer("SELECT coalesce(max(audit_id) - min(audit_id) + 1, 0) FROM audit");
}

Result<AuditState> verify_audit(Database& database, const std::string& where, std::string_view seen_head,
                                const std::function<void(const AuditEntry&)>& each) {
  if (!database.has_table("audit"))
    return fail(Fault::corrupt, where,
                "has no audit; a store made by an earlier version gets one when it is next opened");
  const AuditEntry before = last_removed(database);
  AuditState state;
  state.removed = before.id;
  bool seen = seen_head.empty() || seen_head == before.hash;
  TRY_ASSIGN(const AuditEntry last,
             follow_links(database, where, before, std::numeric_limits<std::int64_t>::max(),
                          [&](const AuditEntry& entry) {
                            seen = seen || entry.hash == seen_head;
                            ++state.entries;
                            if (each) each(entry);
                          }));
  if (state.entries > 0) state.head = last.hash;
  if (!seen)
    return fail(Fault::corrupt, where,
                "no entry has the hash " + std::string(seen_head) + ": the audit was truncated or recreated" +
                    (state.removed == 0 ? ""
                                        : ", or it is one of the first " + std::to_string(state.removed) +
                                              ", which the retention removed"));
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
