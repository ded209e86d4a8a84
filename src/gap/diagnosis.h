#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "gap/method_parts.h"
#include "gap/recordings.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// A region of one variable in which measured battery power departs from the model.
struct WhereRegion {
  std::string channel;   // which equation it shows in
  std::string variable;  // phase, speed, ...
  std::string label;     // for phases and floor cells; empty for numbers
  double from = 0, to = 0;
  double share = 0;  // of the integral of |P_measured - P_model|, signed: positive spends more
  std::array<double, 2> interval{};  // of the share, 95 %, widened for the number of regions looked at
};

struct DiagnosedParameter {
  std::string name, unit;
  double value = 0;
  double deviation = 0;  // one standard deviation; NaN for a shape that was not estimated
};

struct DiagnosedEffect {
  std::string id;
  double probability = 0;  // that it is there, as such names came true in development trials
  double posterior = 0;    // by the evidence alone
  std::vector<DiagnosedParameter> parameters;  // as the catalogue names them; the first is the strength
  double share = 0;                       // Shapley: fraction of the gap that it closes on held-out missions
  std::vector<std::string> alternatives;  // that these data cannot tell from it
};

struct Outside {
  double probability = 0;
  std::string channel, follows;  // empty: none stands out
};

struct Shrinkage {
  double before = 0, after = 0;      // integral of |P_measured - P_model| over that of |P_measured|, held out
  double fraction = 0;               // 1 - after/before
  std::array<double, 2> interval{};  // of the fraction, 95 %, block bootstrap
  double remaining_over_noise_floor = 0;
};

struct NextDrive {
  std::string manoeuvre;             // what to drive
  std::string separates;             // "a from b"
  double expected_log_evidence = 0;  // that it adds for telling them apart
};

// Where the power of the gap comes from; `motors`: their V i, with the idle power of the robot file.
enum class PowerSource { battery, motors, none };
std::string_view name_of(PowerSource source);

enum class Verdict { none, effects, outside, inconclusive };
std::string_view name_of(Verdict verdict);

// The answer to: where does measured power depart from the model, why, and how much of it goes away.
struct Diagnosis {
  std::string robot_id;
  std::size_t missions = 0, samples = 0;
  bool motor_channels = true;  // false: judged from battery power and motion alone
  PowerSource power = PowerSource::battery;
  double energy_relative = 0;          // (E_measured - E_model) / E_measured
  double power_absolute_relative = 0;  // integral of |P_measured - P_model| over that of |P_measured|
  double noise_floor = 0;              // the part of it that measurement noise makes
  std::vector<WhereRegion> where;      // worst first
  Verdict verdict = Verdict::inconclusive;
  double verdict_probability = 0;
  std::vector<DiagnosedEffect> effects;
  Outside outside;
  std::optional<Shrinkage> shrinkage;
  std::vector<NextDrive> next_drive;
  std::vector<robot::AdoptedEffect> adoptable;  // the effects as a robot file takes them
};

struct DiagnosisSettings {
  double report_probability = 0.5;       // effects from this posterior probability on are named
  std::function<bool(double)> progress;  // called with 0..1; false cancels
  MethodParts parts;
};

// Fault::invalid for unusable recordings, Fault::conflict when cancelled.
Result<Diagnosis> diagnose(const RecordingSet& recordings, const robot::RobotModel& robot,
                           const DiagnosisSettings& settings = {});

}  // namespace joulecast::gap
