#include "ingest/fleet_view.h"

#include "base/byte_archive.h"
#include "signals/archive_members.h"

namespace joulecast::ingest {
namespace {

// Increases with every change of the layout below.
constexpr std::uint32_t layout = 4;

struct Members : signals::ArchiveMembers {
  using ArchiveMembers::of;
  template <class Archive>
  static void of(Archive& a, Contradiction& c) {
    a(c.kind, c.id, c.channel, c.value, c.says, c.untrue, c.told_utime_us);
  }

  template <class Archive>
  static void of(Archive& a, battery::Seen& seen) {
    a(seen.count, seen.mean, seen.variance);
  }

  template <class Archive>
  static void of(Archive& a, ChargeView& c) {
    battery::ChargeEstimate& e = c.estimate;
    a(e.charge, e.sd, e.source, e.default_curve, e.flat_curve, e.current_bias_a, e.current_bias_sd_a);
    battery::ChargingStay& s = c.stay;
    a(c.phase, s.start_utime_us, s.end_utime_us, s.start_charge, s.charged_ah, s.charged_j, s.complete);
    a(c.to_full.duration_s, c.to_full.sd_s);
    a(c.habit.current_a, c.habit.taper_charge, c.habit.taper_time_s, c.habit.end_current_a);
  }

  template <class Archive>
  static void of(Archive& a, RobotSnapshot& s) {
    a(s.robot_id, s.has_model, s.model_version, s.received_utime_us, s.clock_ahead_us, s.sample,
      s.measured_power_w, s.modelled_power_w, s.speed_m_s, s.yaw_rate_rad_s, s.state_of_charge, s.charge,
      s.winding_temperature_c, s.map, s.level, s.mission_id, s.mission_key, s.mission_start_utime_us,
      s.mission_implicit, s.mission_request_utime_us, s.accounts, s.drawn_j, s.returned_j, s.ledger.value,
      s.samples, s.faults, s.fault_notes, s.contradictions, s.missions_left_out);
  }
};

using Archive = ByteArchive<Members>;

// Snapshots are taken once a second, with some jitter.
constexpr std::int64_t least_apart_us = 900'000;

}  // namespace

std::vector<std::byte> snapshot_bytes(const RobotSnapshot& snapshot) {
  std::vector<std::byte> bytes;
  Archive save(&bytes);
  std::uint32_t version = layout;
  RobotSnapshot copy = snapshot;
  save(version, copy);
  return bytes;
}

std::shared_ptr<const RobotSnapshot> snapshot_from_bytes(std::span<const std::byte> bytes) {
  Archive load(bytes);
  std::uint32_t version = 0;
  load(version);
  if (version != layout) return nullptr;
  auto snapshot = std::make_shared<RobotSnapshot>();
  load(*snapshot);
  return load.sound() && load.at_end() ? snapshot : nullptr;
}

void RecentValues::take(const RobotSnapshot& snapshot) {
  const std::int64_t now_us = snapshot.sample.utime_us;
  // A snapshot restored from the store has no live values.
  if (now_us == 0 || snapshot.samples == 0) return;
  const std::lock_guard lock(mutex_);
  std::deque<RecentValue>& values = robots_[snapshot.robot_id];
  if (!values.empty() && now_us < values.back().utime_us) values.clear();
  if (!values.empty() && now_us - values.back().utime_us < least_apart_us) return;
  values.push_back({now_us, snapshot.measured_power_w, snapshot.modelled_power_w, snapshot.speed_m_s,
                    snapshot.sample.pose});
  if (values.size() > most_recent_values) values.pop_front();
}

std::vector<RecentValue> RecentValues::of(std::string_view robot_id) const {
  std::vector<RecentValue> found;
  const std::lock_guard lock(mutex_);
  const auto at = robots_.find(robot_id);
  if (at == robots_.end()) return found;
  for (const RecentValue& value : at->second)
    if (at->second.back().utime_us - value.utime_us < recent_window_us) found.push_back(value);
  return found;
}

}  // namespace joulecast::ingest
