#include "telemetry/channel_watch.h"

#include <algorithm>
#include <cmath>

#include "telemetry/validation.h"

namespace joulecast::telemetry {
namespace {

void count_fault(ChannelTally& tally, const std::string& reason, std::string says) {
  auto& [count, last] = tally.faults[reason];
  ++count;
  last = std::move(says);
}

template <class T>
bool is_of_channel(ChannelTally& tally, const Result<T>& decoded) {
  if (!decoded) {
    count_fault(tally, "undecodable", describe(decoded.error()));
    return false;
  }
  if (decoded->robot_id == tally.robot_id) return true;
  count_fault(tally, "wrong_channel", "the message has robot_id \"" + decoded->robot_id + "\"");
  return false;
}

FieldTally& field_called(ChannelTally& tally, const std::string& name) {
  const auto found = std::ranges::find(tally.fields, name, &FieldTally::name);
  if (found != tally.fields.end()) return *found;
  tally.fields.push_back({.name = name});
  return tally.fields.back();
}

std::string_view name_of(signals::MissionPhase phase) {
  return phase == signals::MissionPhase::started    ? "started"
         : phase == signals::MissionPhase::finished ? "finished"
                                                    : "aborted";
}

}  // namespace

void FieldTally::take(double value) {
  if (!std::isnan(value)) {
    ++measured;
    least = std::fmin(least, value);
    greatest = std::fmax(greatest, value);
  }
  if (value != last && !(std::isnan(value) && std::isnan(last)) && !std::isnan(last)) ++changes;
  last = value;
}

double ChannelTally::rate_hz() const {
  if (bridged > 0) return static_cast<double>(bridged) / bridged_s;
  const double time_s = 1e-6 * static_cast<double>(last_utime_us - first_utime_us);
  return messages > 1 && time_s > 0 ? static_cast<double>(messages - 1) / time_s : 0;
}

ChannelTally& ChannelWatch::begin(const std::string& channel, Subject subject, std::string_view robot_id,
                                  std::int64_t recv_utime_us) {
  const auto [entry, is_new] = channels_.try_emplace(channel);
  ChannelTally& tally = entry->second;
  if (is_new) {
    tally.subject = subject;
    tally.robot_id = robot_id;
    tally.first_utime_us = tally.last_utime_us = recv_utime_us;
    if (subject == Subject::telemetry)
      for (const auto& [name, part, key] : signals::sample_fields)
        tally.fields.push_back({.name = std::string(name).append(part.empty() ? "" : ".").append(part)});
  }
  tally.longest_silence_us = std::max(tally.longest_silence_us, recv_utime_us - tally.last_utime_us);
  tally.last_utime_us = recv_utime_us;
  ++tally.messages;
  return tally;
}

bool ChannelWatch::add(std::string_view channel, std::span<const std::uint8_t> data,
                       std::int64_t recv_utime_us, const Sender& sender) {
  constexpr std::size_t most_senders = 8;
  const auto name = parse_channel(channel);
  if (!name) return false;
  ChannelTally& tally = begin(std::string(channel), name->subject, name->robot_id, recv_utime_us);
  tally.bytes += data.size();
  if (sender.known() && tally.senders.size() < most_senders &&
      std::ranges::find(tally.senders, sender) == tally.senders.end())
    tally.senders.push_back(sender);
  decode(tally, data, recv_utime_us);
  return true;
}

void ChannelWatch::add(const std::string& robot_id, const signals::Sample& sample) {
  ChannelTally& tally =
      begin(channel_of(Subject::telemetry, robot_id), Subject::telemetry, robot_id, sample.utime_us);
  take(tally, robot_id, sample, sample.utime_us);
}

void ChannelWatch::take(ChannelTally& tally, const std::string& robot_id, const signals::Sample& sample,
                        std::int64_t recv_utime_us) {
  tally.clock_ahead_us = sample.utime_us - recv_utime_us;
  if (const auto why = check_plausible(sample)) count_fault(tally, "implausible", telemetry::describe(*why));
  Stream& stream = streams_[robot_id];
  const Placement place = stream.sequence.place(sample.sequence, sample.utime_us);
  tally.sequence = stream.sequence.counters();
  if (place.clock != ClockStep::none) stream.gaps.reset();
  if (place.advances()) stream.gaps.add(sample.utime_us, sample.sequence);
  while (const auto decided = stream.gaps.next()) {
    tally.gaps += decided->step == signals::Step::gap ? 1 : 0;
    if (decided->step != signals::Step::bridged) continue;
    ++tally.bridged;
    tally.bridged_s += decided->step_s;
  }
  tally.powered += std::isfinite(sample.battery_voltage_v) && std::isfinite(sample.battery_current_a) ? 1 : 0;
  const auto numbers = signals::numbers_of(sample);
  for (std::size_t k = 0; k < numbers.size(); ++k) tally.fields[k].take(*numbers[k]);
}

void ChannelWatch::decode(ChannelTally& tally, std::span<const std::uint8_t> data,
                          std::int64_t recv_utime_us) {
  switch (tally.subject) {
    case Subject::telemetry:
      if (const auto decoded = decode_telemetry(data); is_of_channel(tally, decoded))
        take(tally, decoded->robot_id, decoded->sample, recv_utime_us);
      return;
    case Subject::mission_event:
      if (const auto decoded = decode_mission_event(data); is_of_channel(tally, decoded)) {
        if (const auto why = check_plausible(decoded->event))
          count_fault(tally, "implausible", telemetry::describe(*why));
        if (decoded->event.phase == signals::MissionPhase::started) {
          streams_[tally.robot_id].sequence.pause();
          streams_[tally.robot_id].gaps.reset();
        }
        tally.last_text = std::string(name_of(decoded->event.phase)) + " " + decoded->event.mission_id;
        tally.clock_ahead_us = decoded->event.utime_us - recv_utime_us;
      }
      return;
    case Subject::covariates:
      if (const auto decoded = decode_covariates(data); is_of_channel(tally, decoded)) {
        tally.clock_ahead_us = decoded->message.utime_us - recv_utime_us;
        for (const signals::Covariate& covariate : decoded->message.covariates) {
          if (const auto why = check_plausible(covariate))
            count_fault(tally, "implausible", covariate.name + ": " + telemetry::describe(*why));
          field_called(tally, covariate.name).take(covariate.value);
        }
      }
      return;
    case Subject::energy_state:
      if (const auto decoded = decode_energy_state(data); is_of_channel(tally, decoded)) {
        tally.clock_ahead_us = decoded->utime_us - recv_utime_us;
        tally.last_text = decoded->mission_id;
        field_called(tally, "measured_power").take(decoded->measured_power_w);
        field_called(tally, "modelled_power").take(decoded->modelled_power_w);
        field_called(tally, "state_of_charge").take(decoded->state_of_charge);
      }
      return;
  }
}

}  // namespace joulecast::telemetry
