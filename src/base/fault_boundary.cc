#include "base/fault_boundary.h"

#include <mutex>
#include <utility>

namespace joulecast {
namespace {

std::mutex observer_mutex;
FaultObserver& observer() {
  static FaultObserver told;
  return told;
}

}  // namespace

void observe_faults(FaultObserver told) {
  const std::lock_guard lock(observer_mutex);
  observer() = std::move(told);
}

void report_fault(std::string_view part, std::string_view why) noexcept {
  try {
    const std::lock_guard lock(observer_mutex);
    if (observer()) observer()(part, why);
  } catch (...) {
    // A failing observer is ignored: there is no other place to report to.
  }
}

}  // namespace joulecast
