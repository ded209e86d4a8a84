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

}  // namespace joulecast::ingest
