#include "store_kind.h"

namespace joulecast::history {

StoreKind store_kind() {
  return {"Sqlite",
          [](const TemporaryFolder& folder, std::function<std::int64_t()> clock) {
            SqliteOptions options;
            options.path = folder.file("store.db");
            options.now_utime_us = std::move(clock);
            return need(open_sqlite_store(options));
          },
          [](const TemporaryFolder& folder) { return "sqlite:" + folder.file("store.db"); }};
}

}  // namespace joulecast::history
