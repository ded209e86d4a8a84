#include "store_kind.h"

namespace joulecast::history {

StoreKind store_kind() {
  return {"Sqlite",
          [](const TemporaryFolder& folder, std::function<std::int64_t()> clock) {
            return need(open_store(folder.file("store.db"), {.now_utime_us = std::move(clock)}));
          },
          [](const TemporaryFolder& folder) { return "sqlite:" + folder.file("store.db"); }};
}

}  // namespace joulecast::history
