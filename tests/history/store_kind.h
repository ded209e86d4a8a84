#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include "temporary_store.h"

namespace joulecast::history {

// A database that keeps stores.
struct StoreKind {
  std::string name;
  // Opens the store kept in the folder, or under its name, with a clock for retention.
  std::function<std::unique_ptr<Store>(const TemporaryFolder&, std::function<std::int64_t()>)> open;
  std::function<std::string(const TemporaryFolder&)> url;  // of the same store
};

inline std::ostream& operator<<(std::ostream& out, const StoreKind& kind) {
  return out << kind.name;
}

// The one that the test program is about: each links its own.
StoreKind store_kind();

}  // namespace joulecast::history
