#include "client/commands/listen.h"

#include <fmt/format.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "base/try.h"
#include "client/interrupt.h"
#include "telemetry/codec.h"
#include "telemetry/log_recordings.h"

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

Json field_json(const telemetry::FieldTally& field, std::uint64_t messages, double rate_hz) {
  const double share = messages > 0 ? 1.0 / static_cast<double>(messages) : 0;
  return {{"name", field.name},
          {"last", json_number(field.last)},
          {"least", json_number(field.least)},
          {"greatest", json_number(field.greatest)},
          {"measured", field.measured},
          {"change_rate_hz", rate_hz * static_cast<double>(field.changes) * share}};
}

Json tally_json(const std::string& channel, const telemetry::ChannelTally& tally) {
  Json fields = Json::array();
  for (const telemetry::FieldTally& field : tally.fields)
    fields.push_back(field_json(field, tally.messages, tally.rate_hz()));
  Json faults = Json::object();
  for (const auto& [reason, fault] : tally.faults)
    faults[reason] = {{"count", fault.first}, {"last", fault.second}};
  Json out{{"channel", channel},
           {"robot_id", tally.robot_id},
           {"messages", tally.messages},
           {"bytes", tally.bytes},
           {"rate_hz", tally.rate_hz()},
           {"first_utime_us", tally.first_utime_us},
           {"last_utime_us", tally.last_utime_us},
           {"longest_silence_s", 1e-6 * static_cast<double>(tally.longest_silence_us)},
           {"clock_ahead_s", 1e-6 * static_cast<double>(tally.clock_ahead_us)},
           {"senders", tally.senders.size()},
           {"last", tally.last_text},
           {"fields", std::move(fields)},
           {"faults", std::move(faults)}};
  if (tally.subject != telemetry::Subject::telemetry) return out;
  const telemetry::SequenceCounters& s = tally.sequence;
  out["sequence"] = {
      {"missing", s.missing},   {"duplicate", s.duplicate},           {"late", s.late},
      {"restarts", s.restarts}, {"clock_backward", s.clock_backward}, {"clock_forward", s.clock_forward}};
  return out;
}

}  // namespace

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

Json to_json(const telemetry::ChannelWatch& watch) {
  Json channels = Json::array();
  for (const auto& [channel, tally] : watch.channels()) channels.push_back(tally_json(channel, tally));
  return {{"channels", std::move(channels)}};
}

Json to_json(const Listened& listened) {
  Json out = to_json(listened.watch);
  Json& dropped = out["dropped_datagrams"] = Json::object();
  for (std::size_t k = 0; k < telemetry::datagram_fault_names.size(); ++k)
    dropped[std::string(telemetry::datagram_fault_names[k])] = listened.datagrams.faults[k].load();
  return out;
}

}  // namespace joulecast::client
