#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "ingest/counters.h"

namespace joulecast::ingest {

// Log lines of a robot's faults: the first of a kind, then one in ten minutes at most with the number since.
class FaultLog {
 public:
  // The line to log, if it is time for one.
  std::optional<std::string> add(IngestFault fault, std::uint64_t count, const std::string& why,
                                 std::int64_t host_utime_us) {
    const auto [logged, first] = logged_.try_emplace(fault);
    logged->second.since += count;
    if (!first && host_utime_us - logged->second.utime_us < period_us) return {};
    std::string line = fmt::format("{}: {} ({}{})", name_of(fault), why, logged->second.since,
                                   first ? " so far" : " since this was last logged");
    logged->second = {host_utime_us, 0};
    return line;
  }

 private:
  static constexpr std::int64_t period_us = 600'000'000;

  struct Logged {
    std::int64_t utime_us = 0;  // host's, when it was last logged
    std::uint64_t since = 0;    // further ones
  };
  std::map<IngestFault, Logged> logged_;
};

}  // namespace joulecast::ingest
