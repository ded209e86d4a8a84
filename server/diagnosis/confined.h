#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

#include "base/error.h"

namespace joulecast::server {

struct Confinement {
  std::uint64_t max_memory_bytes = std::uint64_t{1} << 30;  // beyond the memory of the process at the call
  std::chrono::milliseconds deadline{3'600'000};
};

// Called with the share done, 0 to 1; returns false to end the work.
using Report = std::function<bool(double)>;

// Runs `work` in a process of its own, forked off this one, and returns its result. A crash, too much memory
// or too much time end that process alone and are an error here, Fault::too_large of the last two. The work
// sees all memory as it is now and changes none of it; it must not use objects that other threads may hold
// locked (store, log). `on_progress` is called on the calling thread about ten times a second; where it
// returns false the work is ended, Fault::stopped. The work's process ends with the calling thread.
Result<std::string> run_confined(const Confinement& limits,
                                 const std::function<Result<std::string>(const Report&)>& work,
                                 const Report& on_progress);

}  // namespace joulecast::server
