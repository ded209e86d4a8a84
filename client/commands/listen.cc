#include "client/commands/listen.h"

#include <fmt/format.h>

#include <chrono>

#include "base/try.h"
#include "client/interrupt.h"
#include "telemetry/codec.h"
#include "telemetry/log_recordings.h"

namespace joulecast::client {

Result<void> listen(const ListenOptions& options, Listened& listened,
                    const std::function<void(const Listened&)>& tick,
                    const std::function<void(const std::string&, const signals::Sample&)>& take) {
  using Clock = std::chrono::steady_clock;
  InterruptGuard interrupt;
  TRY_ASSIGN(auto link, telemetry::LcmLink::open(options.lcm_url));
  const auto handle = [&](const telemetry::Received& message) {
    const auto name = telemetry::parse_channel(message.channel);
    if (!name || (!options.robot_id.empty() && name->robot_id != options.robot_id)) return;
    listened.watch.add(message.channel, message.data, message.recv_utime_us, message.sender);
    if (!take || name->subject != telemetry::Subject::telemetry) return;
    if (const auto decoded = telemetry::decode_telemetry(message.data); decoded)
      take(decoded->robot_id, decoded->sample);
  };
  TRY(link.listen(handle, listened.datagrams));
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
    TRY(link.poll(std::chrono::milliseconds(50)));
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

std::string why_silent(const std::string& lcm_url, const Listened& listened) {
  std::string text = "no robot has been heard on " + lcm_url;
  const auto& others = listened.datagrams.other_channels;
  if (!others.empty())
    return text + fmt::format("; it carries other channels: {}. {}", telemetry::channel_list(others),
                              telemetry::robots_publish);
  return text +
         "; nothing arrived. Is the publisher's LCM_DEFAULT_URL the same (--lcm-url or JOULECAST_LCM_URL)? "
         "Between machines it needs ttl=1 and a route: `ip route add 224.0.0.0/4 dev INTERFACE`";
}

}  // namespace joulecast::client
