#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "gap/checks/readings.h"
#include "robot/robot_model.h"
#include "telemetry/recording_set.h"

// What integrators get wrong, done to sound recordings in memory.
namespace joulecast::gap::mistakes {

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

// Unmeasured readings too.
inline void zero_unmeasured(telemetry::RecordingSet& set) {
  each_sample(set, [](Sample& s) {
    for (double* reading : signals::numbers_of(s)) {
      if (std::isnan(*reading)) *reading = 0;
    }
  });
}

inline void swap_sides(telemetry::RecordingSet& set, std::initializer_list<std::size_t> pairs) {
  each_sample(set, [&](Sample& s) {
    for (const std::size_t k : pairs) std::swap(*signals::numbers_of(s)[k], *signals::numbers_of(s)[k + 1]);
  });
}

// Read anew only every period.
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

inline void clip(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings, double most) {
  each_sample(set, [&](Sample& s) {
    for (const std::size_t k : readings)
      *signals::numbers_of(s)[k] = std::clamp(*signals::numbers_of(s)[k], -most, most);
  });
}

// Readings that come late by this time.
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

// Every n-th row the readings fall to nothing.
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

// A second robot of the same id, which does what this one did in its last mission.
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

// From the middle mission on.
inline void step(telemetry::RecordingSet& set, std::initializer_list<std::size_t> readings, double factor) {
  for (std::size_t m = set.missions.size() / 2; m < set.missions.size(); ++m) {
    for (Sample& s : set.missions[m].samples) {
      for (const std::size_t k : readings) *signals::numbers_of(s)[k] *= factor;
    }
  }
}

struct Mistake {
  std::string name;
  std::string id;       // of the check that it must bring
  std::string channel;  // that the check is about, or where it begins
  bool contradicts = true;
  std::vector<std::size_t> needs;  // readings that must be there
  std::function<void(telemetry::RecordingSet&, const robot::RobotModel&)> make;
};

inline std::vector<Mistake> all_mistakes() {
  using namespace reading;
  constexpr std::size_t w = wheel_velocity, v = motor_voltage, i = motor_current;
  const auto times = [](std::vector<std::size_t> readings, double factor) {
    return [readings, factor](telemetry::RecordingSet& set, const robot::RobotModel&) {
      for (const std::size_t k : readings) multiply(set, {k}, factor);
    };
  };
  constexpr double degrees = 180 / std::numbers::pi, rpm = 30 / std::numbers::pi;
  return {
      {"battery current reversed",
       "battery_current_reversed",
       "battery_current",
       true,
       {battery_voltage, battery_current},
       times({battery_current}, -1)},
      {"battery current in mA",
       "battery_current_scale",
       "battery_current",
       true,
       {battery_voltage, battery_current},
       times({battery_current}, 1000)},
      {"battery current in kA",
       "battery_current_scale",
       "battery_current",
       true,
       {battery_voltage, battery_current},
       times({battery_current}, 0.001)},
      {"battery voltage in mV",
       "battery_voltage_scale",
       "battery_voltage",
       true,
       {battery_voltage},
       times({battery_voltage}, 1000)},
      {"battery voltage written in",
       "constant_channel",
       "battery_voltage",
       false,
       {battery_voltage, battery_current},
       [](telemetry::RecordingSet& set, const robot::RobotModel& r) {
         fill(set, {battery_voltage}, r.battery.nominal_voltage_v);
       }},
      {"battery channels 0",
       "dead_channel",
       "battery_voltage, battery_current",
       true,
       {battery_voltage, battery_current},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) {
         fill(set, {battery_voltage, battery_current}, 0);
       }},
      {"wheels in rpm", "wheel_velocity_scale", "wheel_velocity", true, {}, times({w, w + 1}, rpm)},
      {"wheels in degrees a second",
       "wheel_velocity_scale",
       "wheel_velocity",
       true,
       {},
       times({w, w + 1}, degrees)},
      {"motor shaft for wheels",
       "wheel_velocity_scale",
       "wheel_velocity",
       true,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel& r) {
         multiply(set, {w, w + 1}, r.motor.gear_ratio > 2 ? r.motor.gear_ratio : rpm);
       }},
      {"wheels in m/s",
       "wheel_velocity_scale",
       "wheel_velocity",
       true,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel& r) {
         multiply(set, {w, w + 1}, r.kinematics.wheel_radius_m);
       }},
      {"left wheel reversed", "wheel_velocity_reversed", "wheel_velocity.left", true, {}, times({w + 1}, -1)},
      {"right wheel reversed", "wheel_velocity_reversed", "wheel_velocity.right", true, {}, times({w}, -1)},
      {"wheels reversed", "wheel_velocity_reversed", "wheel_velocity", true, {}, times({w, w + 1}, -1)},
      {"wheels swapped",
       "wheel_velocity_sides_swapped",
       "wheel_velocity",
       true,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { swap_sides(set, {w}); }},
      {"left wheel 0", "dead_channel", "wheel_velocity.left", true, {}, times({w + 1}, 0)},
      {"motor currents reversed",
       "motor_current_reversed",
       "motor_current",
       true,
       {i, i + 1},
       times({i, i + 1}, -1)},
      {"left motor current reversed",
       "motor_current_reversed",
       "motor_current.left",
       true,
       {i, i + 1},
       times({i + 1}, -1)},
      {"right motor current reversed",
       "motor_current_reversed",
       "motor_current.right",
       true,
       {i, i + 1},
       times({i}, -1)},
      {"motor currents in mA",
       "motor_current_scale",
       "motor_current",
       true,
       {i, i + 1},
       times({i, i + 1}, 1000)},
      {"motor currents swapped",
       "motor_current_sides_swapped",
       "motor_current",
       true,
       {v, v + 1, i, i + 1},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { swap_sides(set, {i}); }},
      {"right motor current 0", "dead_channel", "motor_current.right", true, {i, i + 1}, times({i}, 0)},
      {"right motor current weak",
       "motor_current_against_sibling",
       "motor_current.right",
       true,
       {v, v + 1, i, i + 1},
       times({i}, 0.4)},
      {"motor voltages reversed",
       "motor_voltage_reversed",
       "motor_voltage",
       true,
       {v, v + 1, i, i + 1},
       times({v, v + 1}, -1)},
      {"left motor voltage reversed",
       "motor_voltage_reversed",
       "motor_voltage.left",
       true,
       {v, v + 1, i, i + 1},
       times({v + 1}, -1)},
      {"motor voltages swapped",
       "motor_voltage_sides_swapped",
       "motor_voltage",
       true,
       {v, v + 1, i, i + 1},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { swap_sides(set, {v}); }},
      {"motors swapped",
       "motor_sides_swapped",
       "motor_voltage",
       true,
       {v, v + 1, i, i + 1},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) {
         swap_sides(set, {v, i});
       }},
      {"motor voltages in mV",
       "motor_voltage_scale",
       "motor_voltage",
       true,
       {v, v + 1},
       times({v, v + 1}, 1000)},
      {"motor currents without sign",
       "motor_current_unsigned",
       "motor_current",
       true,
       {i, i + 1},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) {
         each_sample(set, [](Sample& s) {
           for (double& a : s.motor_current_a) a = std::fabs(a);
         });
       }},
      {"supply for motor voltages",
       "supply_for_motor_voltage",
       "motor_voltage",
       true,
       {v, v + 1, battery_voltage},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) {
         each_sample(set, [](Sample& s) { s.motor_voltage_v = {s.battery_voltage_v, s.battery_voltage_v}; });
       }},
      {"gyro reversed", "yaw_rate_reversed", "yaw_rate", true, {yaw_rate}, times({yaw_rate}, -1)},
      {"gyro in degrees", "yaw_rate_scale", "yaw_rate", true, {yaw_rate}, times({yaw_rate}, degrees)},
      {"gyro 0", "dead_channel", "yaw_rate", true, {yaw_rate}, times({yaw_rate}, 0)},
      {"heading reversed", "pose_heading_reversed", "pose.heading", true, {heading}, times({heading}, -1)},
      {"heading in degrees",
       "pose_heading_scale",
       "pose.heading",
       true,
       {heading},
       times({heading}, degrees)},
      {"position in mm", "pose_scale", "pose", true, {x, y}, times({x, y}, 1000)},
      {"all unmeasured 0",
       "dead_channel",
       "",
       true,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) {
         fill(set, {v, v + 1, i, i + 1}, 0);
         zero_unmeasured(set);
       }},
      {"utime in ms",
       "utime_scale",
       "utime",
       true,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { scale_clock(set, 1e-3); }},
      {"utime in ns",
       "utime_scale",
       "utime",
       true,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { scale_clock(set, 1e3); }},
      {"two senders",
       "two_senders",
       "utime",
       true,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { add_second_sender(set); }},
      {"battery current held 1 s",
       "held_samples",
       "battery_current",
       false,
       {battery_current},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { hold(set, {battery_current}, 1.0); }},
      {"motor currents late by 0.25 s",
       "electrical_delay",
       "motor_current",
       false,
       {v, v + 1, i, i + 1},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) {
         delay(set, {v, v + 1, i, i + 1, battery_voltage, battery_current}, 0.25);
       }},
      {"gyro late by 0.25 s",
       "yaw_rate_delay",
       "yaw_rate",
       false,
       {yaw_rate},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { delay(set, {yaw_rate}, 0.25); }},
      {"wheels fall to 0 for a row",
       "thrown_readings",
       "wheel_velocity.right",
       false,
       {},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) {
         drop_out(set, {w, w + 1}, 57);
       }},
      {"battery power up by 30 % half-way",
       "step_between_missions",
       "battery_current",
       false,
       {battery_voltage, battery_current},
       [](telemetry::RecordingSet& set, const robot::RobotModel&) { step(set, {battery_current}, 1.3); }},
  };
}

}  // namespace joulecast::gap::mistakes
