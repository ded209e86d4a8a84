#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "history/open_store.h"

namespace joulecast::history {

// A folder that goes with the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "joulecast-history-XXXXXX").string();
    path_ = mkdtemp(pattern.data());
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// Applies one command in a transaction of its own.
inline Outcome apply_one(Store& store, const Command& command) {
  auto outcomes = store.apply({&command, 1});
  if (!outcomes) return tl::unexpected(outcomes.error());
  return outcomes->front();
}

// The value of a result that must be one.
template <class T>
T need(Result<T> result) {
  if (!result) throw std::runtime_error(describe(result.error()));
  return std::move(*result);
}

// An open mission without model under a key of the store, not started yet.
inline Mission new_mission(Store& store, const std::string& robot_id, const std::string& mission_id,
                           std::int64_t start_utime_us) {
  Mission mission;
  mission.key = need(store.new_mission_key());
  mission.robot_id = robot_id;
  mission.mission_id = mission_id;
  mission.start_utime_us = start_utime_us;
  mission.end_utime_us = start_utime_us;
  return mission;
}

inline Mission start_mission(Store& store, const std::string& robot_id, const std::string& mission_id,
                             std::int64_t start_utime_us) {
  Mission mission = new_mission(store, robot_id, mission_id, start_utime_us);
  need(apply_one(store, StartMission{mission}));
  return mission;
}

// Samples that differ in every number, 10 ms apart.
inline std::vector<signals::Sample> some_samples(std::int64_t first_utime_us, std::int64_t first_sequence,
                                                 std::size_t count) {
  std::vector<signals::Sample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto n = static_cast<std::int64_t>(i);
    samples[i].utime_us = first_utime_us + 10'000 * n;
    samples[i].sequence = first_sequence + n;
    samples[i].battery_voltage_v = 24.0 + 0.001 * static_cast<double>(samples[i].sequence);
    samples[i].wheel_velocity_rad_s = {static_cast<double>(samples[i].sequence), -1.0};
  }
  return samples;
}

}  // namespace joulecast::history
