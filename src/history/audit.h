#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "history/records.h"
#include "history/sql.h"

// The audit of a store: entries chained by SHA-256, so that a change of one is a break of the chain. The
// chain begins with entry 1, or behind the entries that the last entry of the action "audit_shortened" states
// as removed: {"entries", "last_id", "last_hash"}.
namespace joulecast::history {

// The hash of an entry: SHA-256, in hexadecimal, over the hash of the one before (64 zeros for the first) and
// the entry's members in the order of AuditEntry but for its own hash, each as "<bytes>:<text>,".
std::string audit_hash(std::string_view previous_hash, const AuditEntry& entry);

// Adds the entry behind the last one; its id and hash are made here. Answers the id. Throws SqlError.
std::int64_t append_audit(Database& database, AuditEntry entry);

// As PruneAudit, of entries before a time; Fault::corrupt, and nothing is removed, where a link of them is
// broken. Throws SqlError.
Result<std::int64_t> shorten_audit(Database& database, std::int64_t before_utime_us, std::int64_t max_entries,
                                   std::int64_t now_utime_us);

// The number of entries, if none is missing within the chain. Throws SqlError.
std::int64_t count_audit(Database& database);

struct AuditState {
  std::int64_t entries = 0;
  std::int64_t removed = 0;  // entries before these
  std::string head;          // the last entry's hash; empty without entries
};

// Verifies every link of the audit's chain in the store of a URL or path, also while a daemon writes it.
// `each`, when set, receives the verified entries, in order. Fault::corrupt names the first invalid entry.
// With `seen_head` it is also Fault::corrupt if no entry has that hash: the audit was truncated or recreated
// since the hash was noted.
Result<AuditState> verify_audit(const std::string& store_url, std::string_view seen_head = {},
                                const std::function<void(const AuditEntry&)>& each = {});
// The same of an opened store, which errors call `where`. Throws SqlError.
Result<AuditState> verify_audit(Database& database, const std::string& where, std::string_view seen_head = {},
                                const std::function<void(const AuditEntry&)>& each = {});

}  // namespace joulecast::history
