#include "windows/windows.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/support/sample_robots.h"
#include "tests/windows/recordings.h"
#include "windows/track.h"

namespace joulecast::windows {
namespace {

using signals::Sample;
using telemetry::Recording;

std::vector<Window> windows_of(const std::vector<Recording>& missions, const WindowSettings& settings = {}) {
  const robot::RobotModel robot = testing::nomad();
  return make_windows(missions, robot, find_readings(missions), settings);
}

// Every channel a straight line in time; the robot drives a circle of 2 m.
void straight_lines(double t, Sample& s) {
  s.wheel_velocity_rad_s = {3 + 0.2 * t, 2 + 0.1 * t};
  s.motor_voltage_v = {5 + t, 6 - 0.5 * t};
  s.motor_current_a = {1 + 0.1 * t, 2 - 0.1 * t};
  s.battery_voltage_v = 25 - 0.01 * t;
  s.battery_current_a = 2 + 0.3 * t;
  s.yaw_rate_rad_s = 0.4;
  s.pose = {t, 3 * t, 0.4 * t};
}

class AnyRate : public ::testing::TestWithParam<double> {};

TEST_P(AnyRate, KeepsMeansAndSlopes) {
  const double rate_hz = GetParam();
  const auto windows =
      windows_of({testing::recorded(static_cast<std::size_t>(40 * rate_hz), rate_hz, straight_lines)});
  const double length = std::max(0.4, 8 / rate_hz);
  ASSERT_GE(windows.size(), static_cast<std::size_t>(2 * 39 / length) - 3);
  for (std::size_t k = 0; k < windows.size(); ++k) {
    const Window& w = windows[k];
    const double t = w.t_s;
    EXPECT_NEAR(w.length_s, length, 1e-6);
    EXPECT_NEAR(t, length / 2 + static_cast<double>(k) * length / 2, 1e-5);
    EXPECT_EQ(w.continues, k > 0);
    EXPECT_FALSE(w.reading || w.motors_apart);
    // A sample may fall on either side of the window's middle: tolerance of a twentieth of a sample's step.
    const double off = 0.05 / rate_hz;
    EXPECT_NEAR(w.speed_rad_s[0], 3 + 0.2 * t, off);
    EXPECT_NEAR(w.acceleration_rad_s2[0], 0.2, 1e-9);
    EXPECT_NEAR(w.acceleration_rad_s2[1], 0.1, 1e-9);
    // Without L di/dt, 2.6 mH times -0.1 A/s.
    EXPECT_NEAR(w.voltage_v[1], 6 - 0.5 * t + 0.1 * testing::nomad().motor.inductance_h, off);
    EXPECT_NEAR(w.voltage_slope_v_s[0], 1, 1e-9);
    EXPECT_NEAR(w.current_a[0], 1 + 0.1 * t, off);
    EXPECT_NEAR(w.current_slope_a_s[1], -0.1, 1e-9);
    EXPECT_NEAR(w.battery_voltage_v, 25 - 0.01 * t, off);
    EXPECT_NEAR(w.battery_current_a, 2 + 0.3 * t, off);
    EXPECT_NEAR(w.yaw_rate_rad_s, 0.4, 1e-12);
    EXPECT_NEAR(w.x_m, t, off);
    EXPECT_NEAR(w.y_m, 3 * t, 3 * off);
    EXPECT_NEAR(w.heading_rad, 0.4 * t, off);
    EXPECT_TRUE(w.moving[0] && w.moving[1]);
  }
}

INSTANTIATE_TEST_SUITE_P(Rates, AnyRate, ::testing::Values(1.0, 10.0, 50.0, 200.0));

TEST(Windows, AllFiniteChannelsStayFinite) {
  // At rest for a third of the time, constant channels, uneven sampling.
  Recording mission = testing::recorded(3000, 50, [](double t, Sample& s) {
    straight_lines(t, s);
    if (t > 20 && t < 40) s.wheel_velocity_rad_s = {0, 0};
    s.battery_voltage_v = 24;
    s.motor_voltage_v = {0, 0};
  });
  for (std::size_t k = 0; k < mission.samples.size(); ++k) mission.samples[k].utime_us += (k % 7) * 1500;
  for (const Window& w : windows_of({mission})) {
    for (const std::size_t s : {0u, 1u}) {
      EXPECT_TRUE(
          std::isfinite(w.speed_rad_s[s] + w.acceleration_rad_s2[s] + w.voltage_v[s] + w.current_a[s]));
      EXPECT_TRUE(std::isfinite(w.voltage_slope_v_s[s] + w.current_slope_a_s[s] + w.motor_power_w[s]));
      EXPECT_TRUE(std::isfinite(w.motor_power_abs_w[s] + w.braking_w[s] + w.current_sign[s]));
      for (const auto& heat : w.copper_heat_w) EXPECT_TRUE(std::isfinite(heat[s]));
      for (const auto& part : w.part_speed_rad_s) EXPECT_TRUE(std::isfinite(part[s]));
    }
    EXPECT_TRUE(std::isfinite(w.battery_voltage_v + w.battery_current_a + w.battery_power_w));
    EXPECT_TRUE(std::isfinite(w.battery_power_slope_w_s + w.charge_as));
    EXPECT_TRUE(std::isfinite(w.yaw_rate_rad_s + w.x_m + w.y_m + w.heading_rad));
    EXPECT_NEAR(w.battery_voltage_v, 24, 1e-9);
  }
}

TEST(Windows, UnmeasuredChannelsAreNan) {
  for (const Window& w : windows_of({testing::recorded(500, 50, [](double, Sample& s) {
         s.wheel_velocity_rad_s = {2, 2};
       })})) {
    EXPECT_TRUE(std::isnan(w.voltage_v[0]) && std::isnan(w.current_a[1]) && std::isnan(w.motor_power_w[0]));
    EXPECT_TRUE(std::isnan(w.battery_voltage_v) && std::isnan(w.battery_current_a) &&
                std::isnan(w.battery_power_w));
    EXPECT_TRUE(std::isnan(w.yaw_rate_rad_s) && std::isnan(w.x_m) && std::isnan(w.climb_rad) &&
                std::isnan(w.forward_m));
  }
}

TEST(Windows, ExcludeGaps) {
  const Recording whole = testing::recorded(2000, 50, straight_lines);
  for (const double wide : {0.3, 5.0}) {
    for (double from = 10; from < 10.41; from += 0.04) {
      const auto windows = windows_of({testing::without(whole, from, from + wide)});
      std::size_t breaks = 0;
      for (const Window& w : windows) {
        // Up to the longest gap may be missing at an end.
        const double covered = 0.5 * w.length_s - WindowSettings{}.longest_gap_s - 0.02;
        EXPECT_FALSE(w.t_s - covered < from + wide && w.t_s + covered > from)
            << from << " " << wide << " " << w.t_s;
        EXPECT_NEAR(w.acceleration_rad_s2[0], 0.2, 1e-9);
        breaks += w.continues ? 0 : 1;
      }
      EXPECT_EQ(breaks, 2u);
    }
  }
}

TEST(Windows, BelongToTheirMissions) {
  const Recording mission = testing::recorded(500, 50, straight_lines);
  const auto windows = windows_of({mission, mission});
  const std::size_t half = windows.size() / 2;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    EXPECT_EQ(windows[k].mission, k / half);
    EXPECT_EQ(windows[k].t_s, windows[k % half].t_s);
  }
  EXPECT_FALSE(windows[half].continues);
}

TEST(Windows, ThinsWindowsEvenlyAtLimit) {
  const Recording fast = testing::recorded(20000, 50, straight_lines);
  const auto all = windows_of({fast});
  WindowSettings few;
  few.most_windows = 1000;
  const auto some = windows_of({fast}, few);
  EXPECT_EQ(all.size(), 1998u);
  EXPECT_LE(some.size(), 1000u);
  EXPECT_GE(some.size(), 900u);
  EXPECT_GT(some.back().t_s, 380);
  std::size_t begins = 0;
  for (const Window& w : some) begins += w.continues ? 0 : 1;
  EXPECT_EQ(begins, 20u);
}

TEST(Windows, SlowRecordingsKeepEveryWindow) {
  // 2 h at 1 Hz are 1800 windows of 8 s, not 36,000.
  const auto windows = windows_of({testing::recorded(7200, 1, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {3 + std::sin(0.1 * t), 3};
  })});
  EXPECT_EQ(windows.size(), 1798u);
  for (std::size_t k = 1; k < windows.size(); ++k) EXPECT_TRUE(windows[k].continues);
}

TEST(Windows, WindowIsRestOrMotion) {
  // At rest until 4 s, accelerating with 0.5 rad/s^2 until 8 s, then turning evenly.
  const auto mission = testing::recorded(600, 50, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {t < 4 ? 0 : std::min(0.5 * (t - 4), 2.0), 0};
    s.motor_current_a = {0.4, 0};
  });
  for (const Window& w : windows_of({mission})) {
    EXPECT_TRUE(w.resting[1]);
    EXPECT_FALSE(w.moving[1]);
    const double from = w.t_s - 0.2, to = w.t_s + 0.2;
    if (to < 3.95) {
      EXPECT_TRUE(w.resting[0] && !w.moving[0]) << w.t_s;
      EXPECT_EQ(w.current_sign[0], 0);
    }
    if (to > 4.15) {
      EXPECT_FALSE(w.resting[0]) << w.t_s;
    }
    // Slides after 0.1 rad: 0.25 (t - 4)^2 reaches it after 0.63 s.
    if (from < 4.5) {
      EXPECT_FALSE(w.moving[0]) << w.t_s;
    }
    if (from > 4.75) {
      EXPECT_TRUE(w.moving[0] && !w.resting[0]) << w.t_s;
      EXPECT_NEAR(w.current_sign[0], 1, 1e-3);
    }
  }
}

TEST(Windows, VoltageExcludesFileInductance) {
  // V = 2 i + 0.5 di/dt, as of a winding of 2 ohm and 0.5 H.
  robot::RobotModel robot = testing::nomad();
  robot.motor.inductance_h = 0.5;
  const std::vector missions{testing::recorded(1000, 50, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {3, 3};
    const double amps = 1 + std::sin(3 * t), slope = 3 * std::cos(3 * t);
    s.motor_current_a = {amps, amps};
    s.motor_voltage_v = {2 * amps + 0.5 * slope, 2 * amps + 0.5 * slope};
  })};
  for (const Window& w : make_windows(missions, robot, find_readings(missions)))
    EXPECT_NEAR(w.voltage_v[0], 2 * w.current_a[0], 0.01) << w.t_s;
}

TEST(Windows, KeepMeanMissionVoltage) {
  const std::vector missions{testing::recorded(500, 50, straight_lines)};
  for (const Window& w : windows_of(missions))
    EXPECT_NEAR(w.mission_voltage_v, 25 - 0.01 * 499 / 50 / 2, 1e-9);
}

TEST(Windows, PartsAverageToMean) {
  for (const Window& w : windows_of({testing::recorded(500, 50, straight_lines)})) {
    double weight = 0, mean = 0;
    for (std::size_t part = 0; part < 3; ++part) {
      weight += w.part_weight[part];
      mean += w.part_weight[part] * w.part_speed_rad_s[part][0];
    }
    EXPECT_NEAR(weight, 1, 1e-12);
    EXPECT_NEAR(mean, w.speed_rad_s[0], 1e-12);
    EXPECT_LT(w.part_speed_rad_s[0][0], w.part_speed_rad_s[1][0]);
    EXPECT_LT(w.part_speed_rad_s[1][0], w.part_speed_rad_s[2][0]);
  }
}

TEST(Windows, MapProgressOncePerSpan) {
  // Wheels of 0.1 m at 5 rad/s should give 0.5 m/s; the map shows 0.45 towards 0.6 rad, backwards after 10 s.
  const auto mission = testing::recorded(1000, 50, [](double t, Sample& s) {
    const double way = t < 10 ? t : 20 - t;
    s.wheel_velocity_rad_s = t < 10 ? std::array{5.0, 5.0} : std::array{-5.0, -5.0};
    s.pose = {0.45 * way * std::cos(0.6), 0.45 * way * std::sin(0.6), 0.6};
  });
  std::size_t spans = 0;
  for (const Window& w : windows_of({mission})) {
    if (!std::isfinite(w.forward_m) || std::fabs(w.t_s - 9.5) < 0.8) continue;
    ++spans;
    const double way = w.t_s < 9 ? 1 : -1;
    EXPECT_NEAR(w.forward_m, way * 0.45, 1e-6) << w.t_s;
    EXPECT_NEAR(w.span_angle_rad[0], way * 5, 1e-6);
    EXPECT_NEAR(w.turn_rad, 0, 1e-9);
    EXPECT_NEAR(w.chord, 1, 1e-9);
  }
  EXPECT_GE(spans, 15u);
}

TEST(Windows, AveragesCovariates) {
  Recording mission = testing::recorded(500, 50, [](double, Sample& s) { s.wheel_velocity_rad_s = {4, 4}; });
  const auto at = [](double t) { return testing::start_us + std::llround(1e6 * t); };
  mission.covariates = {{.name = "heater_w", .utime_us = {at(0), at(5)}, .value = {10, 30}},
                        {.name = "constant", .utime_us = {at(0), at(3)}, .value = {7, 7}},
                        {.name = "ambient_c", .utime_us = {at(4)}, .value = {21}},
                        {.name = "height_m", .utime_us = {at(0), at(1)}, .value = {0, 1}}};
  Recording other = mission;
  other.covariates = {{.name = "ambient_c", .utime_us = {at(0)}, .value = {25}}};
  const std::vector<Recording> missions{mission, other};
  EXPECT_EQ(covariate_names(missions), (std::vector<std::string>{"ambient_c", "heater_w"}));
  for (const Window& w : windows_of(missions)) {
    ASSERT_EQ(w.covariates.size(), 2u);
    const double from = w.t_s - 0.2, to = w.t_s + 0.2;
    if (w.mission == 1) {
      EXPECT_NEAR(w.covariates[0], 25, 1e-9);
      EXPECT_TRUE(std::isnan(w.covariates[1]));
      continue;
    }
    EXPECT_EQ(std::isnan(w.covariates[0]), from < 3.99) << w.t_s;
    if (to < 5) {
      EXPECT_NEAR(w.covariates[1], 10, 1e-9);
    } else if (from > 5) {
      EXPECT_NEAR(w.covariates[1], 30, 1e-9);
    } else {
      EXPECT_TRUE(w.covariates[1] > 10 - 1e-9 && w.covariates[1] < 30 + 1e-9);
    }
  }
}

TEST(Windows, DerivesClimb) {
  Recording pitched = testing::recorded(500, 50, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {4, 4};
    s.pitch_rad = 0.01 * t;
  });
  Recording high = testing::recorded(500, 50, [](double, Sample& s) { s.wheel_velocity_rad_s = {4, 4}; });
  signals::CovariateSeries height{.name = "height_m", .utime_us = {}, .value = {}};
  for (const Sample& s : high.samples) {
    height.utime_us.push_back(s.utime_us);
    height.value.push_back(-0.03 * 0.4 * 1e-6 * static_cast<double>(s.utime_us - testing::start_us));
  }
  high.covariates = {height};
  for (const Window& w : windows_of({pitched, high}))
    EXPECT_NEAR(w.climb_rad, w.mission == 0 ? 0.01 * w.t_s : -std::asin(0.03), w.mission == 0 ? 1e-4 : 1e-6);
}

TEST(Windows, RemovesElectricalDelay) {
  const auto mission = testing::recorded(1000, 50, [](double t, Sample& s) {
    s.wheel_velocity_rad_s = {3 + std::sin(2 * t), 3};
    s.battery_voltage_v = 24;
    s.battery_current_a = 3 + std::sin(2 * (t - 0.1));
    s.motor_current_a = {1, 1};
  });
  WindowSettings settings;
  settings.electrical_delay_s = 0.1;
  for (const Window& w : windows_of({mission}, settings)) {
    EXPECT_EQ(w.electrical_shift_s, 0.1);
    if (w.t_s < 19) {
      EXPECT_NEAR(w.battery_current_a, w.speed_rad_s[0], 2e-4) << w.t_s;
    }
  }
}

}  // namespace
}  // namespace joulecast::windows
