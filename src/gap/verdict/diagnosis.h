#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plausibility/check.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

using plausibility::Check;

// Called with the share of the work that is done; false cancels a diagnosis of recordings.
using Progress = std::function<bool(double)>;

// A region of one variable in which measured battery power departs from the model.
struct WhereRegion {
  std::string channel;   // equation in which it is visible
  std::string variable;  // phase, speed_m_s, ..., floor_m
  std::string label;     // for phases and floor cells; empty for numbers
  double from = 0, to = 0;
  double share = 0;       // of the integral of |P_measured - P_model|, signed: positive spends more
  double time_share = 0;  // of the time: the share expected of an evenly spread gap
  std::array<double, 2> interval{};  // of the share, 95 %, widened for the number of regions tested
};

struct DiagnosedParameter {
  std::string name, unit;
  double value = 0;
  double deviation = 0;  // one standard deviation; NaN for a shape that was not estimated
};

struct DiagnosedEffect {
  std::string id;                              // of the catalogue, or "covariate:<name>"
  double probability = 0;                      // that it is present
  double group = 0;                            // that it or one of its alternatives is present
  std::vector<DiagnosedParameter> parameters;  // as the catalogue names them; the first is the strength
  double share = 0;                            // of the removed gap that returns without it, held out
  double power_w = 0;                          // mean |change of battery power|
  double varies = 0;                           // of its strength along the recordings, sd over the strength
  std::vector<std::string> alternatives;       // that these data cannot distinguish from it
  // The alternatives that a robot file can take, each with its strength when it replaces this effect.
  std::vector<robot::AdoptedEffect> instead{};
  std::string calibrates;  // parameter of the robot file that it would correct; empty: none
};

// A cause that no effect of the catalogue describes.
struct Outside {
  double probability = 0;
  std::string channel, follows;     // empty: none is significant
  std::string like;                 // the effect that has the same form, where its strength varies
  std::array<double, 2> power_w{};  // of that form, at the beginning and at the end of a mission
};

// How large the gap of one kind of reading is.
struct ChannelGap {
  std::string channel;  // battery_power, motor_power, battery_voltage, yaw_rate
  double absolute_relative = 0, noise_floor = 0;
};

struct BaselineTerm {
  std::string name, unit;
  double value = 0, deviation = 0;
  double model =
      std::numeric_limits<double>::quiet_NaN();  // coefficient of the robot file's model in the same term
  double explained = std::numeric_limits<double>::quiet_NaN();  // the same with the effects found
};

// A difference of power that is certain although several effects have its form.
struct TermSum {
  std::string terms;  // of the regression that contain it
  double difference_w = 0, deviation_w = 0;
  std::vector<std::string> effects;  // that would explain it
  // Parameter of the robot file that could take all of it, with its value then; empty: none.
  std::string parameter, unit;
  double value = 0, deviation = 0;
};

// A linear regression of power on motion. Errors are mean |error| over mean |power|, on the same held-out
// blocks.
struct Baseline {
  std::vector<BaselineTerm> terms;
  double held_out = 0;                  // of the regression
  double unchanged_model_held_out = 0;  // of the robot file
  // Of the explanation, re-estimated without each part; with the function outside the catalogue where one is
  // reported.
  double explanation_held_out = 0;
  double deviation = 0;  // standard error of the difference between the last and the better of the others
  std::vector<std::string> says;  // its terms compared with the model's, as text
  // True if the explanation's error exceeds the better of the others by more than a tenth, or by more than a
  // twentieth and the standard error.
  bool wins() const {
    constexpr double slight = 1.05, clear = 1.1;
    const double best = std::min(held_out, unchanged_model_held_out);
    return explanation_held_out > clear * best ||
           (explanation_held_out > slight * best && explanation_held_out - best > deviation);
  }
};

// The gap on held-out parts: effects and strengths are re-estimated without each.
struct Shrinkage {
  double before = 0, after = 0;      // integral of |P_measured - P_model| over that of |P_measured|, held out
  double fraction = 0;               // 1 - after/before
  std::array<double, 2> interval{};  // of the fraction, 95 %, bootstrap over blocks
  double remaining_over_noise_floor = 0;
  std::size_t parts = 0;  // left out
};

struct NextDrive {
  std::string manoeuvre;             // manoeuvre to drive
  std::string separates;             // "a from b"
  double expected_log_evidence = 0;  // that it adds for distinguishing them; NaN: unknown
};

// One parameter of the robot file as these recordings estimate it.
struct FileCorrection {
  std::string parameter;  // as "motor.friction_torque_nm"; its name contains the unit
  double file = 0, fits = 0, deviation = 0;
};

// Origin of the gap's power; `motors`: their V i, without the base load.
enum class PowerSource { battery, motors, none };
inline constexpr std::array<std::string_view, 3> power_source_names{"battery", "motors", "none"};
constexpr std::string_view name_of(PowerSource source) {
  return power_source_names[static_cast<std::size_t>(source)];
}

enum class Verdict { none, effects, outside, inconclusive, not_this_robot };
inline constexpr std::array<std::string_view, 5> verdict_names{"none", "effects", "outside", "inconclusive",
                                                               "not_this_robot"};
inline constexpr std::array<std::string_view, 5> verdict_titles{
    "no gap", "effects found", "outside the catalogue", "inconclusive", "not this robot"};
constexpr std::string_view name_of(Verdict verdict) {
  return verdict_names[static_cast<std::size_t>(verdict)];
}
constexpr std::string_view title_of(Verdict verdict) {
  return verdict_titles[static_cast<std::size_t>(verdict)];
}

// Data of a report's plots; the report computes nothing.
struct Figures {
  struct Bin {
    double from = 0, to = 0;
    double before_w = 0, after_w = 0;  // mean |residual power|
    double half_width_w = 0;           // half of a 95 % interval of before_w; NaN: too few blocks
    std::size_t windows = 0;
    std::string label;
  };
  struct Map {
    std::string axis;
    std::vector<Bin> bins;
  };
  struct Point {
    double t_s = 0, measured_w = 0, before_w = 0, after_w = 0;  // NaN breaks the line
  };
  struct Mission {
    std::string mission_id;
    std::int64_t start_utime_us = 0;
    double length_s = 0, payload_kg = 0;
    // Relative to the measured energy or |power|: the model as it is, and with the effects found.
    double energy_before = 0, energy_after = 0, power_before = 0, power_after = 0;
  };
  std::vector<Map> maps;
  double cell_m = 0;
  std::vector<Bin> floor;  // squares with their lower corners at (from, to)
  std::string stretch_of;  // mission of the interval of power over time
  std::vector<Point> power;
  std::vector<Mission> missions;
  double mean_power_w = 0;
};

// The diagnosis: the regions where measured power departs from the model, the causes, and the part of the gap
// that they remove.
struct Diagnosis {
  std::string robot_id;
  std::size_t missions = 0, samples = 0;
  std::vector<std::string> notes;  // missions joined or left out, messages that could not be read
  bool motor_channels = true;      // false: estimated from battery power and motion alone
  PowerSource power = PowerSource::battery;
  double energy_relative = 0;          // (E_measured - E_model) / E_measured
  double power_absolute_relative = 0;  // integral of |P_measured - P_model| over that of |P_measured|
  double noise_floor = 0;              // the part of it that no unstructured fit removes either
  double detectable_share = 0;         // of the power: smallest effect that these data can detect
  std::vector<ChannelGap> channels;
  std::vector<Check> checks;
  std::optional<Baseline> baseline;
  std::vector<TermSum> sums;
  std::vector<WhereRegion> where;  // worst first
  Verdict verdict = Verdict::inconclusive;
  double verdict_probability = 0;
  std::vector<std::string> reasons;  // sentences on the limits of the verdict
  std::vector<DiagnosedEffect> effects;
  Outside outside;
  std::optional<Shrinkage> shrinkage;
  std::vector<FileCorrection> corrections;  // verdict not_this_robot: values that would fit in the robot file
  std::vector<NextDrive> next_drive;
  std::vector<robot::AdoptedEffect> adoptable;  // the effects as a robot file takes them
  std::string refusal;                          // why they are not to be adopted; empty: they may be
  Figures figures;
};

}  // namespace joulecast::gap
