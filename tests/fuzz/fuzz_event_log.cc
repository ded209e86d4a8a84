#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "fuzz.h"
#include "telemetry/event_log.h"

namespace t = joulecast::telemetry;

// Each byte of a log is in a returned event or is skipped and counted; the sum is the log's size.
JOULECAST_FUZZ_TARGET(event_log) {
  std::size_t at = 0;
  const std::size_t piece = size > 0 ? 1 + data[0] % 64 : 1;
  t::EventLogReader reader(
      [&](std::span<std::uint8_t> into) {
        const std::size_t count = std::min({piece, into.size(), size - at});
        if (count > 0) std::memcpy(into.data(), data + at, count);
        at += count;
        return static_cast<std::ptrdiff_t>(count);
      },
      {63, 4096, 256});
  std::uint64_t in_events = 0;
  while (true) {
    const t::LogRead read = reader.next();
    if (read.offset != in_events + reader.skipped_bytes()) std::abort();
    if (read.status == t::LogStatus::end) break;
    if (read.status == t::LogStatus::event) {
      in_events += t::log_header_size + read.event.channel.size() + read.event.data.size();
      continue;
    }
    if (reader.resync() == 0) std::abort();
  }
  if (in_events + reader.skipped_bytes() != size) std::abort();
}
