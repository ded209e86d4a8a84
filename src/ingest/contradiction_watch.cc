#include "ingest/contradiction_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "plausibility/check.h"
#include "telemetry/impossible.h"

namespace joulecast::ingest {
namespace {

// Of which the faulty ones are counted; their share may be certain before all have come. A tenth of a second
// of a fast robot does not reach it.
constexpr std::uint64_t window_messages = 50;
constexpr std::uint64_t first_samples = 300;  // of a mission, before its channels are compared ...
constexpr std::uint64_t rate_samples = 20;    // ... and its rate, of 2 Hz within 10 s
constexpr double constant_s =
    10;  // of motion: coarse readings of a steady drive may stay the same for some seconds
constexpr double says_enough_s = 60;  // of motion, after which a contradiction that is gone is cleared
// Multiple of the speed or yaw rate limit that no robot reaches by overshoot: such readings are no motion.
constexpr double absurd_limit = 3;

ContradictionKind kind_of(std::string_view id) {
  if (id.starts_with("utime")) return ContradictionKind::clock;
  if (id == "two_senders") return ContradictionKind::sender;
  if (id == "dead_channel") return ContradictionKind::dead;
  if (id == "thrown_readings" || id == "wheel_velocity_leaps") return ContradictionKind::corrupt;
  if (id.ends_with("_over_limit")) return ContradictionKind::limit;
  if (id.ends_with("swapped")) return ContradictionKind::sides;
  if (id.ends_with("_scale")) return ContradictionKind::scale;
  if (id.ends_with("_reversed") || id.ends_with("_unsigned")) return ContradictionKind::sign;
  return ContradictionKind::constant;
}

// Whether any of the channels is used in a mission's accounts or for training: commands and gyros are not.
bool enters_accounts(std::string_view channels) {
  for (std::size_t from = 0; from < channels.size();) {
    const std::size_t end = std::min(channels.find(", ", from), channels.size());
    const std::string_view one = channels.substr(from, end - from);
    if (!one.starts_with("velocity_command") && !one.starts_with("yaw_rate")) return true;
    from = end + 2;
  }
  return false;
}

// A stream that is too slow for accounts of currents, if it is.
std::vector<Contradiction> slowness_of(const plausibility::Observation& seen) {
  const double rate_hz = 1 / seen.clock.period_s();
  const std::string says = telemetry::slow_stream(rate_hz);
  if (says.empty()) return {};
  return {{ContradictionKind::clock, "utime_slow", "utime", rate_hz, "The telemetry " + says + "."}};
}

std::vector<Contradiction> contradictions_of(const plausibility::Observation& seen,
                                             const robot::RobotModel& robot) {
  std::vector<Contradiction> found = slowness_of(seen);
  for (plausibility::Check& check : plausibility::check_contradictions({&seen, 1}, robot)) {
    const ContradictionKind kind = kind_of(check.id);
    if (kind == ContradictionKind::constant && seen.moving_s < constant_s) continue;
    const bool untrue = (check.contradicted || kind == ContradictionKind::corrupt ||
                         (kind == ContradictionKind::limit && check.value > absurd_limit)) &&
                        enters_accounts(check.channel);
    found.push_back(
        {kind, std::move(check.id), std::move(check.channel), check.value, std::move(check.says), untrue});
  }
  return found;
}

// Faults of messages that indicate a mistake if they affect a large share of the messages.
struct Telling {
  IngestFault fault;
  ContradictionKind kind;
  const char* id;
  const char* channel;
  bool untrue;
  const char* says;  // after "49 of 50 messages"
};
constexpr Telling tellings[] = {
    {IngestFault::implausible, ContradictionKind::implausible, "implausible", "", true,
     "are refused for a value that no robot sends"},
    {IngestFault::impossible, ContradictionKind::implausible, "impossible_readings", "battery_voltage", false,
     "have readings that this robot cannot have, which count as not measured"},
    {IngestFault::undecodable, ContradictionKind::implausible, "undecodable", "", false,
     "cannot be decoded: are the publisher's message types those of joulecast?"},
    {IngestFault::wrong_channel, ContradictionKind::identity, "wrong_channel", "robot_id", false,
     "name another robot_id than the channel that they come on, and are refused"},
    {IngestFault::second_sender, ContradictionKind::sender, "second_sender", "", false,
     "come from a second sender under this robot's id, and are refused: each robot needs its own id"},
    {IngestFault::too_far_ahead, ContradictionKind::clock, "clock_far_ahead", "utime", false,
     "are stamped too far ahead of the service's clock and refused: is the robot's clock set (NTP), and "
     "utime in microseconds?"},
    {IngestFault::clock_ahead, ContradictionKind::clock, "clock_ahead", "utime", false,
     "are stamped more than 10 s ahead of the service's clock: is the robot's clock set (NTP)?"},
    {IngestFault::clock_backward, ContradictionKind::clock, "clock_standing", "utime", true,
     "are stamped no later than the one before: utime stands or goes back; joulecast expects the instant of "
     "sampling"},
    {IngestFault::clock_forward, ContradictionKind::clock, "clock_leaping", "utime", true,
     "are stamped more than an hour after the one before: utime must be the instant of sampling, in "
     "microseconds"},
    {IngestFault::missing, ContradictionKind::sequence, "sequence_skipping", "sequence", false,
     "come after missing sequence numbers: are messages lost on the network, or not all published, as of a "
     "throttled topic? sequence must count the published messages"},
    {IngestFault::restart, ContradictionKind::sequence, "sequence_standing", "sequence", false,
     "do not increase sequence: it is constant or restarts, so that lost messages cannot be counted; "
     "joulecast expects it one higher with each message"},
};

bool told_in(const std::vector<Contradiction>& list, const Contradiction& one) {
  return std::ranges::any_of(list, [&](const Contradiction& c) { return c.same(one); });
}

}  // namespace

bool doubts_battery(const std::vector<Contradiction>& contradictions) {
  return std::ranges::any_of(contradictions, [](const Contradiction& c) {
    return c.untrue && c.kind != ContradictionKind::corrupt &&
           c.channel.find("battery_") != std::string::npos;
  });
}

ContradictionWatch::ContradictionWatch(const robot::RobotModel& robot, const dynamics::DriveModel& drive)
    : robot_(robot), observer_(robot, drive) {}

void ContradictionWatch::hear(std::uint64_t messages) {
  messages_ += messages;
  if (messages_ >= window_messages || is_decided_) judge_messages();
}

void ContradictionWatch::hear(IngestFault fault, std::uint64_t count, const std::string& why) {
  const auto k = static_cast<std::size_t>(fault);
  faults_[k] += count;
  if (!why.empty()) why_[k] = why;
  is_decided_ |= static_cast<double>(faults_[k]) >= telemetry::mistaken_share * window_messages;
}

void ContradictionWatch::judge_messages() {
  std::vector<Contradiction> found;
  for (const Telling& t : tellings) {
    const auto k = static_cast<std::size_t>(t.fault);
    const double share = static_cast<double>(faults_[k]) / static_cast<double>(messages_);
    if (share < telemetry::mistaken_share) continue;
    std::string says = fmt::format("{} of {} messages {}{}", faults_[k], messages_, t.says,
                                   why_[k].empty() ? "" : " (" + why_[k] + ")");
    if (!says.ends_with('?')) says += '.';
    found.push_back({t.kind, t.id, t.channel, share, std::move(says), t.untrue});
    if (t.untrue && in_mission_ && !told_in(untrue_messages_, found.back()))
      untrue_messages_.push_back(found.back());
  }
  const auto same = [](const Contradiction& a, const Contradiction& b) { return a.same(b); };
  if (!std::ranges::equal(found, of_messages_, same)) changed_ = true;
  of_messages_ = std::move(found);
  faults_ = {};
  messages_ = 0;
  is_decided_ = false;
}

void ContradictionWatch::begin_mission(const std::string& mission_id, double payload_kg) {
  observer_.begin(mission_id, payload_kg);
  samples_ = 0;
  next_ = first_samples;
  in_mission_ = true;
  changed_ = changed_ || !of_mission_.empty();
  of_mission_.clear();
  untrue_messages_.clear();
  std::ranges::copy_if(of_messages_, std::back_inserter(untrue_messages_), &Contradiction::untrue);
}

void ContradictionWatch::add(const signals::Sample& sample) {
  if (!in_mission_) return;
  observer_.add(sample);
  if (++samples_ == rate_samples) judge_channels(slowness_of(observer_.so_far()), false);
  if (samples_ < next_) return;
  next_ *= 2;
  const plausibility::Observation seen = observer_.so_far();
  judge_channels(contradictions_of(seen, robot_), seen.moving_s >= says_enough_s);
}

std::vector<Contradiction> ContradictionWatch::end_mission() {
  if (!in_mission_) return {};
  in_mission_ = false;
  // A short mission ends before its window.
  if (2 * messages_ >= window_messages) judge_messages();
  const plausibility::Observation seen = observer_.finish();
  std::vector<Contradiction> found = contradictions_of(seen, robot_);
  judge_channels(found, seen.moving_s > 0);
  std::ranges::copy(untrue_messages_, std::back_inserter(found));
  std::ranges::copy(of_mission_, std::back_inserter(found));
  return found;
}

void ContradictionWatch::doubt_mission(Contradiction why) {
  if (!in_mission_ || told_in(of_mission_, why)) return;
  of_mission_.push_back(std::move(why));
  changed_ = true;
}

void ContradictionWatch::doubt_missions(std::optional<Contradiction> why) {
  changed_ = changed_ || why.has_value() != of_missions_.has_value();
  of_missions_ = std::move(why);
}

void ContradictionWatch::judge_channels(std::vector<Contradiction> found, bool replace) {
  if (!replace) {
    for (const Contradiction& c : of_channels_)
      if (!told_in(found, c)) found.push_back(c);
  }
  const auto was_told = [this](const Contradiction& c) { return told_in(of_channels_, c); };
  changed_ |= found.size() != of_channels_.size() || !std::ranges::all_of(found, was_told);
  keep_channels(std::move(found));
}

void ContradictionWatch::keep_channels(std::vector<Contradiction> found) {
  of_channels_ = std::move(found);
  doubts_battery_ = ingest::doubts_battery(of_channels_);
}

std::vector<Contradiction> ContradictionWatch::all() const {
  std::vector<Contradiction> list = of_messages_;
  std::ranges::copy(of_channels_, std::back_inserter(list));
  std::ranges::copy(of_mission_, std::back_inserter(list));
  if (of_missions_) list.push_back(*of_missions_);
  return list;
}

}  // namespace joulecast::ingest
