#include "client/commands/listen.h"

#include <fmt/format.h>

#include <chrono>

#include "client/interrupt.h"
#include "telemetry/codec.h"
#include "telemetry/lcm_link.h"

namespace joulecast::client {

std::int64_t host_utime_us() {
  using namespace std::chrono;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

Result<void> listen(const ListenOptions& options, Listened& listened,
                    const std::function<void(const Listened&)>& tick,
                    const std::function<void(const std::string&, const signals::Sample&)>& take) {
  using Clock = std::chrono::steady_clock;
  InterruptGuard interrupt;
  auto link = telemetry::LcmLink::open(options.lcm_url);
  if (!link) return tl::unexpected(std::move(link.error()));
  const auto handle = [&](const telemetry::Received& message) {
    const auto name = telemetry::parse_channel(message.channel);
    if (!name || (!options.robot_id.empty() && name->robot_id != options.robot_id)) return;
    listened.watch.add(message.channel, message.data, message.recv_utime_us, message.sender);
    if (!take || name->subject != telemetry::Subject::telemetry) return;
    if (const auto decoded = telemetry::decode_telemetry(message.data); decoded)
      take(decoded->robot_id, decoded->sample);
  };
  if (auto heard = link->listen(handle, listened.datagrams); !heard) return heard;
  const auto begin = Clock::now();
  auto due = begin;
  const auto over = [&] {
    return options.seconds > 0 &&
           std::chrono::duration<double>(Clock::now() - begin).count() >= options.seconds;
  };
  while (!over() && !interrupt.interrupted()) {
    if (tick && Clock::now() >= due) {
      tick(listened);
      due = Clock::now() + std::chrono::seconds(1);
    }
    if (auto polled = link->poll(std::chrono::milliseconds(50)); !polled)
      return tl::unexpected(std::move(polled.error()));
  }
  return {};
}

std::string dropped_datagrams(const Listened& listened) {
  std::string text;
  for (std::size_t k = 0; k < telemetry::datagram_fault_names.size(); ++k) {
    const std::uint64_t count = listened.datagrams.faults[k].load();
    if (count == 0 || k == static_cast<std::size_t>(telemetry::DatagramFault::other_channel)) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, telemetry::datagram_fault_names[k]);
  }
  return text;
}

}  // namespace joulecast::client
