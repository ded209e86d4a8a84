#include "ingest/fault_log.h"

#include <fmt/format.h>

namespace joulecast::ingest {

constexpr std::int64_t period_us = 600'000'000;

std::optional<std::string> FaultLog::add(IngestFault fault, std::uint64_t count, const std::string& why,
                                         std::int64_t host_utime_us) {
  const auto [logged, first] = logged_.try_emplace(fault);
  logged->second.since += count;
  if (!first && host_utime_us - logged->second.utime_us < period_us) return {};
  std::string line = fmt::format("{}: {} ({}{})", name_of(fault), why, logged->second.since,
                                 first ? " so far" : " since this was last logged");
  logged->second = {host_utime_us, 0};
  return line;
}

}  // namespace joulecast::ingest
