#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "telemetry/codec.h"
#include "telemetry/datagram.h"

namespace joulecast::testing {

// Reads the bytes as a script of datagrams and checks the guarantees of DatagramReader. The first byte of a
// step selects the sender (2 bits), whether time passes, and the form of the datagram: 0 is followed by a
// length of two bytes and a raw datagram; otherwise seven bytes give a fragment's header, so that offsets and
// sizes match often.
inline void run_datagram_script(std::span<const std::uint8_t> script) {
  telemetry::DatagramCounters counters;
  const telemetry::ReassemblyLimits limits;
  telemetry::DatagramReader reader(counters, limits);
  std::int64_t now_us = 0;
  std::uint64_t messages = 0, datagrams = 0;
  const auto next = [&]() -> std::uint8_t {
    if (script.empty()) return 0;
    const std::uint8_t byte = script.front();
    script = script.subspan(1);
    return byte;
  };
  const auto append = [](std::vector<std::uint8_t>& bytes, std::uint32_t value, int size) {
    for (int shift = 8 * (size - 1); shift >= 0; shift -= 8)
      bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  };
  while (!script.empty()) {
    const std::uint8_t kind = next();
    const telemetry::Sender sender{0x0a000001u + (kind & 3u), 7};
    if ((kind & 4) != 0) now_us += 400'000;
    std::vector<std::uint8_t> datagram;
    if (kind >> 3 == 0) {
      std::size_t length = next();
      length = length << 8 | next();
      length = std::min(script.size(), length);
      datagram.assign(script.begin(), script.begin() + static_cast<std::ptrdiff_t>(length));
      script = script.subspan(length);
    } else {
      constexpr std::uint32_t sizes[] = {0, 1, 100, 4096, 65'535, 65'536, 65'537, 0xffffffff};
      append(datagram, 0x4c433033, 4);
      append(datagram, next() & 3u, 4);
      append(datagram, sizes[next() & 7] - (next() & 3u), 4);
      const std::uint32_t offset = sizes[next() & 7];
      append(datagram, offset + next() - 128u, 4);
      const std::uint8_t numbers = next();
      append(datagram, numbers & 15u, 2);
      append(datagram, numbers >> 4, 2);
      for (const char c :
           {'R', 'O', 'B', 'O', 'T', '_', 'T', 'E', 'L', 'E', 'M', 'E', 'T', 'R', 'Y', '.', 'r', '\0'})
        if ((numbers & 15) == 0) datagram.push_back(static_cast<std::uint8_t>(c));
      datagram.resize(datagram.size() + std::min<std::size_t>(60'000, std::size_t{next()} << (kind >> 4)),
                      0x55);
    }
    ++datagrams;
    const auto message = reader.take(sender, datagram, now_us);
    if (reader.messages_begun() > limits.messages) std::abort();
    if (!message) continue;
    ++messages;
    if (message->data.size() > telemetry::max_message_bytes || !telemetry::parse_channel(message->channel))
      std::abort();
    (void)telemetry::decode_telemetry(message->data);
  }
  reader.expire(now_us + limits.timeout_us + 1);
  if (reader.messages_begun() != 0 || counters.received != datagrams || messages > datagrams) std::abort();
}

}  // namespace joulecast::testing
