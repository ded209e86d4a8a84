#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ingest/by_robot.h"
#include "ingest/charge_watch.h"
#include "ingest/counters.h"
#include "signals/ledger.h"
#include "signals/sample.h"

namespace joulecast::ingest {

// The state of one robot at one moment; immutable once published.
struct RobotSnapshot {
  std::string robot_id;
  bool has_model = false;
  std::int64_t model_version = 0;
  std::int64_t received_utime_us = 0;  // host clock at the last message; 0 = never received
  std::int64_t clock_ahead_us = 0;     // robot's clock less the host's at the last sample received
  signals::Sample sample;              // the last one accounted for
  double measured_power_w = signals::unmeasured;
  double modelled_power_w = signals::unmeasured;
  double speed_m_s = signals::unmeasured;
  double yaw_rate_rad_s = signals::unmeasured;
  double state_of_charge = signals::unmeasured;  // of charge.estimate
  ChargeView charge;
  std::array<double, 2> winding_temperature_c{signals::unmeasured, signals::unmeasured};
  std::string map, level;  // labels of the covariates of these names; empty: none
  std::string mission_id;  // empty: no mission open
  std::int64_t mission_key = 0;
  std::int64_t mission_start_utime_us = 0;
  bool mission_implicit = false;
  std::int64_t mission_request_utime_us = 0;  // of the last MissionRequest that was carried out
  signals::Accounts accounts;                 // of the open mission
  // Within missions since the daemon started, J.
  double drawn_j = 0, returned_j = 0;
  signals::Ledger ledger;
  std::uint64_t samples = 0;
  std::map<std::string, std::uint64_t>
      faults;  // reason -> messages rejected or repaired, since the daemon started
  std::map<std::string, std::string> fault_notes;  // reason -> description of the latest
  std::vector<Contradiction> contradictions;
  // Reason -> missions not used for training, since the daemon started.
  std::map<std::string, std::uint64_t> missions_left_out;
};

// The latest snapshot of every robot.
class FleetView : ByRobot<RobotSnapshot> {
 public:
  using ByRobot::all, ByRobot::find, ByRobot::Pointer, ByRobot::remove, ByRobot::size;

  void publish(Pointer snapshot) {
    const std::string& robot_id = snapshot->robot_id;
    put(robot_id, std::move(snapshot));
  }
};

// A robot's snapshot as the daemons of a cluster hand it on.
std::vector<std::byte> snapshot_bytes(const RobotSnapshot& snapshot);

// Null for bytes that a version of the program with another layout wrote.
std::shared_ptr<const RobotSnapshot> snapshot_from_bytes(std::span<const std::byte> bytes);

inline constexpr std::int64_t recent_window_us = 90'000'000;
inline constexpr std::size_t most_recent_values = 90;  // of a robot

// A robot's live values at one moment; NaN: not measured.
struct RecentValue {
  std::int64_t utime_us = 0;  // robot's clock
  double measured_power_w = signals::unmeasured;
  double modelled_power_w = signals::unmeasured;
  double speed_m_s = signals::unmeasured;
  std::array<double, 3> pose{signals::unmeasured, signals::unmeasured, signals::unmeasured};  // m, m, rad
};

// The last 90 s of every robot's live values, at most one a second, for charts that begin filled: at most 5
// kB a robot. Any thread takes and reads.
class RecentValues {
 public:
  // Takes the snapshot's sample if it is a second younger than the last. A clock set back clears the values.
  void take(const RobotSnapshot& snapshot);
  // Removes robots for which `is_known(id)` is false.
  template <class Known>
  void keep(Known is_known) {
    const std::lock_guard lock(mutex_);
    std::erase_if(robots_, [&](const auto& each) { return !is_known(each.first); });
  }
  // Oldest first; empty if no value was received.
  std::vector<RecentValue> of(std::string_view robot_id) const;

 private:
  mutable std::mutex mutex_;
  std::map<std::string, std::deque<RecentValue>, std::less<>> robots_;  // oldest first
};

}  // namespace joulecast::ingest
