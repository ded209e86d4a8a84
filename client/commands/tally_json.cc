#include "client/commands/tally_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

Json number_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json();
}

Json field_json(const telemetry::FieldTally& field, std::uint64_t messages, double rate_hz) {
  const double share = messages > 0 ? 1.0 / static_cast<double>(messages) : 0;
  return {{"name", field.name},
          {"last", number_or_null(field.last)},
          {"least", number_or_null(field.least)},
          {"greatest", number_or_null(field.greatest)},
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
