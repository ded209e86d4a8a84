#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <utility>
#include <vector>

#include "plausibility/readings.h"
#include "telemetry/log_recordings.h"

// Alterations of correct recordings in memory.
namespace joulecast::alter {

using signals::Sample;
using telemetry::Recording;

inline void each_sample(telemetry::RecordingSet& set, const std::function<void(Sample&)>& change) {
  for (Recording& mission : set.missions) {
    for (Sample& s : mission.samples) change(s);
  }
}

inline void multiply(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings,
                     double factor) {
  each_sample(set, [&](Sample& s) {
    for (const std::size_t k : readings) *signals::numbers_of(s)[k] *= factor;
  });
}

inline void fill(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings, double value) {
  each_sample(set, [&](Sample& s) {
    for (const std::size_t k : readings) *signals::numbers_of(s)[k] = value;
  });
}

inline void swap_sides(telemetry::RecordingSet& set, std::initializer_list<std::size_t> pairs) {
  each_sample(set, [&](Sample& s) {
    for (const std::size_t k : pairs) std::swap(*signals::numbers_of(s)[k], *signals::numbers_of(s)[k + 1]);
  });
}

// Updates the readings once per period and holds them.
inline void hold(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings, double period_s) {
  for (Recording& mission : set.missions) {
    for (const std::size_t k : readings) {
      std::int64_t next_us = mission.samples.front().utime_us;
      double value = 0;
      for (Sample& s : mission.samples) {
        double& reading = *signals::numbers_of(s)[k];
        if (s.utime_us >= next_us) {
          value = reading;
          next_us += static_cast<std::int64_t>(1e6 * period_s);
        }
        reading = value;
      }
    }
  }
}

inline void round_to(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings, double step) {
  each_sample(set, [&](Sample& s) {
    for (const std::size_t k : readings)
      *signals::numbers_of(s)[k] = step * std::round(*signals::numbers_of(s)[k] / step);
  });
}

inline void delay(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings, double delay_s) {
  for (Recording& mission : set.missions) {
    const std::vector<Sample> before = mission.samples;
    std::size_t from = 0;
    for (Sample& s : mission.samples) {
      const std::int64_t then = s.utime_us - static_cast<std::int64_t>(1e6 * delay_s);
      while (from + 1 < before.size() && before[from + 1].utime_us <= then) ++from;
      for (const std::size_t k : readings) *signals::numbers_of(s)[k] = *signals::numbers_of(before[from])[k];
    }
  }
}

// Sets the readings to 0 in every n-th row.
inline void drop_out(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings,
                     std::size_t n) {
  for (Recording& mission : set.missions) {
    for (std::size_t row = n / 2; row < mission.samples.size(); row += n) {
      for (const std::size_t k : readings) *signals::numbers_of(mission.samples[row])[k] = 0;
    }
  }
}

inline void scale_clock(telemetry::RecordingSet& set, double factor) {
  each_sample(set, [&](Sample& s) {
    s.utime_us = static_cast<std::int64_t>(static_cast<double>(s.utime_us) * factor);
  });
}

// Adds a second robot of the same id that repeats the last mission.
inline void add_second_sender(telemetry::RecordingSet& set) {
  const std::vector<Sample> other = set.missions.back().samples;
  for (Recording& mission : set.missions) {
    const std::size_t n = std::min(other.size(), mission.samples.size());
    std::vector<Sample> both;
    for (std::size_t k = 0; k < mission.samples.size(); ++k) {
      both.push_back(mission.samples[k]);
      if (k >= n) continue;
      both.push_back(other[k]);
      both.back().utime_us = mission.samples[k].utime_us + 3000;
      both.back().sequence = 7000 + static_cast<std::int64_t>(k);
    }
    mission.samples = std::move(both);
  }
}

// Scales the readings from the middle mission on.
inline void step(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings, double factor) {
  for (std::size_t m = set.missions.size() / 2; m < set.missions.size(); ++m) {
    for (Sample& s : set.missions[m].samples) {
      for (const std::size_t k : readings) *signals::numbers_of(s)[k] *= factor;
    }
  }
}

}  // namespace joulecast::alter
