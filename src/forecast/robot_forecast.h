#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "drift/marks.h"
#include "dynamics/drive_model.h"
#include "forecast/correction.h"
#include "forecast/leg.h"
#include "forecast/leg_cost.h"
#include "forecast/scores.h"

namespace joulecast::forecast {

// A leg with its model cost.
struct PricedLeg {
  Motion motion = Motion::stand;
  double payload_kg = 0;
  double way_m = 0;  // driven
  LegCost cost;
  Driving driving = Driving::stated;
  bool may_halt = false;  // one of the robot's usual halts may follow
};

// The parts of a plan that its energy, duration and uncertainty depend on; plans add up leg by leg.
struct PlanSum {
  std::array<Features, subject_count> features{};
  std::array<std::array<double, motion_count>, subject_count> squares{};  // of its legs' corrected amounts
  std::array<double, 2> stops{};  // after drives, after turns, at which the robot may halt
  double stated_s = 0;            // of stated legs
  double way_m = 0;
  bool slower = false, impossible = false;  // a leg is driven slower than wanted, or cannot be driven

  // Multiplies the plan by `copies`.
  void repeat(double copies);
};

// The state of one robot's forecasts at one moment; immutable.
class Forecaster {
 public:
  struct Track {
    Correction correction;
    double common = 0;                           // relative deviation that all legs of a mission share
    std::array<double, motion_count> scatter{};  // relative deviation of a leg, by motion
    ScoreDistribution scores;
    double inflation = 1;  // of the spread, by adaptive conformal inference
  };

  std::array<Track, subject_count> tracks;
  Habit habit;
  double standing_w = 0;
  std::vector<Leg> typical;  // recent moving legs, for range and run time
  double payload_limit_kg = 0;
  std::int64_t missions = 0;          // learnt from
  std::int64_t siblings = 0;          // robots that contributed findings
  std::optional<drift::Mark> change;  // the last one

  const Track& track(Subject subject) const { return tracks[static_cast<std::size_t>(subject)]; }

  // Adds `copies` of a leg, each with its own scatter.
  void extend(PlanSum& sum, const PricedLeg& leg, double copies = 1) const;
  Prediction energy(const PlanSum& sum) const;    // J
  Prediction duration(const PlanSum& sum) const;  // s
  double amount(const Features& features, Subject subject) const;

 private:
  void count(PlanSum& sum, Subject subject, Motion motion, const Features& x, double copies) const;
  Prediction joined(const PlanSum& sum, std::span<const Subject> subjects, double halt_unit) const;
};

// Learns from the missions of one robot as they end, against its model in force. Each mission is first
// predicted from the missions before it; its score then calibrates the intervals (prequential split
// conformal). The scores of a robot with few missions are those of another forecast than the one in force:
// they are biased and have another width. Each time that a quarter of the kept missions is new, all is
// estimated from the kept ones again, each scored by the others (jackknife+, Barber, Candes, Ramdas and
// Tibshirani 2021). The hit or miss of the 90 % interval adapts their width (Gibbs and Candes 2021, on the
// logarithm of the width). Missions before the robot's last change (drift/marks.h) are set aside.
class RobotForecast {
 public:
  static constexpr std::size_t most_missions = 120;  // kept to learn again when the model changes
  static constexpr double interval = 0.9;

  // `drive` must be the drive model of `robot`.
  RobotForecast(robot::RobotModel robot, dynamics::DriveModel drive);

  // Learns with the siblings' present findings. Missions without measured legs are ignored.
  void learn(PastMission mission);

  // Puts another model in force and learns from the kept missions again.
  void set_model(robot::RobotModel robot, dynamics::DriveModel drive);

  // Sets the robot's last change; learns from the kept missions again if it is another one.
  void set_change(std::optional<drift::Mark> change);

  // One for each Subject.
  void set_siblings(std::array<Siblings, subject_count> siblings);
  std::array<OwnFinding, subject_count> findings() const;

  // The forecaster of the missions learned so far.
  std::shared_ptr<const Forecaster> forecaster() const;

 private:
  struct Sum {  // of squared deviations, and of their references
    double squares = 0, weight = 0;
  };
  struct Learning {
    CorrectionFit fit;
    Scores scores;
    std::array<Sum, motion_count> scatter{};
    Sum common{};
    double log_inflation = 0;
  };

  // A mission's legs for a subject: first the predicted ones, then those that are only learned from.
  struct Seen {
    std::vector<Evidence> legs;
    std::vector<Motion> motions;
    std::size_t foreseen = 0;
    double measured = 0;  // of the foreseen
    double halted = 0;    // measured while standing, where halts are not foreseen one by one
    PlanSum sum;          // of the foreseen

    Prediction predicted(Subject subject, const Forecaster& by) const;
    double score(const Prediction& p) const;
  };

  // Of the siblings; null without.
  const Habit* kind_habit() const { return siblings_[0].habit ? &*siblings_[0].habit : nullptr; }
  void learn_anew();
  Scatter scatter(Subject subject, const Scatter& start) const;
  Forecaster::Track track(Subject subject) const;
  Seen seen(Subject subject, const PastMission& mission, const Forecaster& now) const;
  Forecaster with_track(Subject subject) const;
  void score(Subject subject, const PastMission& mission);
  void learn_scatter(Subject subject, const Seen& seen, const Correction& fitted);
  void learn_common(Subject subject, const Seen& seen, const Forecaster& without);
  void settle(Subject subject);
  bool changed(const PastMission& before, const PastMission& now) const;
  bool changed_at(std::size_t k) const { return k > 0 && changed(missions_[k - 1], missions_[k]); }

  robot::RobotModel robot_;
  dynamics::DriveModel drive_;
  Habit habit_;
  double standing_w_ = 0;
  std::deque<PastMission> missions_;
  std::array<Learning, subject_count> learning_;
  std::array<Siblings, subject_count> siblings_;
  std::optional<drift::Mark> change_;
  std::int64_t learnt_ = 0, settles_at_ = 1;
};

}  // namespace joulecast::forecast
