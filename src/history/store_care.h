#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/store_copy.h"

// Maintenance of a store's file: check, backup, restore, and salvage of a damaged one. None of it opens the
// store as Store does, and nothing is migrated.
namespace joulecast::history {

using StoreCheck = ContentReport;

// Checks the content, pages, indexes and references. May run while a daemon uses the store. Fault::not_found
// when there is no such file, ::corrupt when it is no store at all, ::conflict when it is of another version.
Result<StoreCheck> check_store(const std::string& path);

// Copies the store into a new file, compact, while others use it, and checks the copy. Fault::conflict when
// there is a file already; ::corrupt when the store is damaged: then there is no copy.
Result<StoreCheck> back_up_store(const std::string& path, const std::string& copy);

// Replaces the store at `path` by a copy of the store `from`. The old store is kept next to it, with its
// journal and spool, under the returned name (empty: there was none). Fault::conflict while a daemon holds
// the store; ::corrupt if `from` is not sound: then nothing is changed.
Result<std::string> restore_store(const std::string& from, const std::string& path);

struct Salvage {
  std::int64_t rows = 0;            // in the new store
  std::vector<std::string> losses;  // rows that could not be read or kept, and the file's damage
};

// Copies the readable rows of a damaged store, table by table, into a new one, and drops rows that then refer
// to missing ones. Fault::conflict if there is a file already.
Result<Salvage> salvage_store(const std::string& damaged, const std::string& into);

}  // namespace joulecast::history
