#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "robot/robot_model.h"
#include "signals/sample.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

// The voltages that a pack of this nominal voltage can have at its terminals: cells are protected below 0.625
// (LiFePO4, 2.0 V of 3.2 V) to 0.75 and charged to at most 1.29 (NiMH, 1.55 V of 1.2 V) of it. Between lie no
// half, double or single cell.
inline constexpr double least_voltage_share = 0.6, greatest_voltage_share = 1.5;

// Share of faulty messages or impossible readings that indicates a mistake. Reboots and losses are far below.
inline constexpr double mistaken_share = 0.2;

// A sentence on telemetry at a rate that is too low for accounts of currents; empty at others.
[[nodiscard]] std::string slow_stream(double rate_hz);

// Readings that one robot cannot have, found from past samples in order of time, with constant memory.
class ImpossibleReadings {
 public:
  explicit ImpossibleReadings(const robot::RobotModel& robot);

  struct Dropped {
    std::string channel;  // field of robot_telemetry_t
    std::string why;      // a sentence
  };
  // Takes such readings out of the sample and returns the first of them; empty where there is none.
  // - Voltage and current of the battery, where the voltage is not one of its pack.
  // - A current, motor voltage or yaw rate beyond the file's limit and all others: by a value that repeats
  //   exactly (655.35, -999, -500), devices state that they have no reading.
  // - A frozen channel: a current, motor voltage or yaw rate that repeats one value while the motion on which
  //   it depends changes, or 0 while the robot moves, for longer than it did before.
  // - Every reading, where all of a noisy stream repeat for longer than before: such a sample lacks motion.
  std::optional<Dropped> drop(signals::Sample& sample);

 private:
  struct Run {
    std::int64_t begin_us = 0;
    std::size_t rows = 0;                  // that count
    std::size_t runs = 0, usual_rows = 0;  // completed ones that were not frozen, and the longest of them
    bool is_long() const;
    void begin(std::int64_t utime_us, bool counts, bool was_frozen);
  };
  struct Channel {
    double value = signals::unmeasured;
    Run run;                          // of rows in which the wheels' speeds differ from the row before
    double slowest = 0, fastest = 0;  // of the motion, over its limit
    double largest = 0;               // reading that is none of the outliers
    double outlier = signals::unmeasured;
    int outliers = 0;  // values of similar size in a row
  };
  static bool outlies(Channel& channel, double value, double limit);
  static bool frozen(Channel& channel, double value, double motion, std::int64_t utime_us, bool counts);
  bool frozen(const signals::Sample& sample, bool moves);

  double nominal_v_;
  double speed_share_s_, turn_share_s_;  // the motion over its limit, of 1 rad/s of the wheels
  double current_a_, yaw_rate_rad_s_;    // beyond which outliers are
  std::array<double, 2> wheels_rad_s_{};
  std::array<Channel, 6> channels_;
  std::array<double, signals::sample_numbers> row_{}, steps_{};
  Run rows_;
  std::size_t noisy_rows_ = 0;
};

inline bool lacks_motion(const signals::Sample& sample) {
  return std::isnan(sample.wheel_velocity_rad_s[0] + sample.wheel_velocity_rad_s[1]);
}

// The readings taken out of recordings, for each channel: the number of samples and the reason of the first.
struct DroppedReadings {
  std::string channel, why;
  std::size_t samples = 0;
};
std::vector<DroppedReadings> drop_impossible(std::vector<Recording>& recordings,
                                             const robot::RobotModel& robot);

}  // namespace joulecast::telemetry
