#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "dynamics/drive_model.h"
#include "forecast/correction.h"
#include "forecast/drift.h"
#include "forecast/leg.h"
#include "forecast/leg_cost.h"
#include "forecast/scores.h"
#include "forecast/siblings.h"

namespace joulecast::forecast {

struct PastMission {
  std::int64_t start_utime_us = 0;
  std::vector<Leg> legs;
};

// A lasting change of what a robot spends.
struct Drift {
  std::int64_t since_utime_us = 0;     // start of the first mission after the change
  std::int64_t detected_utime_us = 0;  // start of the mission that gave it away
  double ratio = 1;                    // measured over expected, geometric mean since the change
  std::int64_t missions = 0;           // since the change
};

// The parts of a plan that its energy and uncertainty depend on; plans add up leg by leg.
struct PlanSum {
  Features features{};
  std::array<double, motion_count> square_j2{};  // of the corrected energies of its legs, by motion
  double duration_s = 0;
  double way_m = 0;
};

// Energy of a plan: corrected * exp(spread * z), z distributed as `scores`.
struct Prediction {
  double corrected_j = 0;  // the model's, with the robot's correction
  double spread = 0;
  const ScoreDistribution* scores = nullptr;  // of the Forecaster

  double quantile_j(double probability) const;
  double mean_j() const;
  // That the energy stays at or below an amount known with a standard deviation (0: exactly).
  double probability_below(double energy_j, double deviation_j = 0) const;
};

// All that forecasts need of one robot at one moment; immutable.
class Forecaster {
 public:
  struct Track {
    Correction correction;
    double common = 0;                           // relative deviation that all legs of a mission share
    std::array<double, motion_count> scatter{};  // relative deviation of a leg, by motion
    ScoreDistribution scores;
    double inflation = 1;  // of the spread, by adaptive conformal inference
  };

  std::array<Track, driving_count> tracks;
  Pace usual;
  std::vector<Leg> typical;  // recent legs, for range and run time
  double payload_limit_kg = 0;
  std::int64_t missions = 0;  // learnt from
  std::int64_t siblings = 0;  // robots that lent their findings
  std::optional<Drift> drift;

  const Track& track(Driving driving) const { return tracks[static_cast<std::size_t>(driving)]; }

  // Adds a leg whose model cost is known. `copies` of it, each with its own scatter.
  void extend(PlanSum& sum, Driving driving, Motion motion, double payload_kg, const LegCost& cost,
              double way_m, double copies = 1) const;
  Prediction predict(const PlanSum& sum, Driving driving) const;
};

// Learns from the missions of one robot as they end, against its model in force. Each mission is first
// predicted from what came before it; its score then calibrates the intervals (prequential split conformal),
// the hit or miss of the 90 % interval adapts their width (Gibbs and Candes 2021, on the logarithm of the
// width), and a CUSUM of the scores watches for drift, upon which what came before the change is set aside.
class RobotForecast {
 public:
  static constexpr std::size_t most_missions = 120;  // kept to learn anew when the model changes
  static constexpr double interval = 0.9;

  // `drive` must be the drive model of `robot`.
  RobotForecast(robot::RobotModel robot, dynamics::DriveModel drive);

  // Learns with what siblings told so far. Returns the drift when this mission gave it away. Missions without
  // measured legs teach nothing.
  std::optional<Drift> learn(PastMission mission);

  // Puts another model in force and learns the kept missions anew.
  void set_model(robot::RobotModel robot, dynamics::DriveModel drive);

  // One a Driving.
  void set_siblings(std::array<Siblings, driving_count> siblings);
  std::array<OwnFinding, driving_count> findings() const;

  // Of what was learnt so far.
  std::shared_ptr<const Forecaster> forecaster() const;

 private:
  struct Sum {  // of squared deviations and what they are relative to
    double squares = 0, weight = 0;
  };
  struct Learning {
    CorrectionFit fit;
    Scores scores;
    std::array<Sum, motion_count> scatter{};
    Sum common{};
    double log_inflation = 0;
  };

  void learn_anew();
  Forecaster::Track track(const Learning& learning, const Siblings& siblings) const;
  LegCost cost(Driving driving, const Leg& leg) const;
  std::vector<Evidence> evidence(Driving driving, const PastMission& mission,
                                 const Forecaster::Track& now) const;
  double score(Driving driving, const PastMission& mission, double& log_ratio);
  void refit(Driving driving, std::size_t from);
  std::optional<Drift> watch(double score, double log_ratio);

  robot::RobotModel robot_;
  dynamics::DriveModel drive_;
  Pace pace_;
  std::deque<PastMission> missions_;
  std::deque<double> log_ratios_;  // of the stated track, one a mission
  std::array<Learning, driving_count> learning_;
  std::array<Siblings, driving_count> siblings_;
  DriftWatch drift_watch_;
  std::optional<Drift> drift_;
  std::int64_t learnt_ = 0, learnt_at_drift_ = 0;
};

}  // namespace joulecast::forecast
