#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "drift/marks.h"
#include "energy/refinement.h"
#include "history/records.h"
#include "ingest/counters.h"
#include "robot/robot_model.h"
#include "signals/sample.h"

namespace joulecast::ingest {

// The state that survives restarts, besides the refinement's own memory.
struct RefinementProgress {
  std::int64_t judged = 0;  // missions
  // Of the carried payload over the declared, weighted: 1, x, y, x x, x y; the newest ten count most.
  std::array<double, 5> payload_sums{};
  std::int64_t changed_utime_us = 0;             // of the change from which on it is refined
  std::size_t tests = 0;                         // of candidates for this version since then
  std::size_t tested_at = 0;                     // missions used for training at the last one
  std::deque<history::MissionKey> learned_from;  // of the refinement's missions
};

// Refines one robot's friction, idle power, mass and battery resistance from its missions as they come,
// reports payloads that were not declared, and suggests a new model version when the refined one departs.
class RefinementWatch {
 public:
  static constexpr std::string_view topic = "refinement";  // of its memory in the store

  // The model must be one that the catalogue of effects accepts.
  RefinementWatch(const robot::RobotModel& robot, std::int64_t version);

  // Another version of the robot's model came in force; between missions.
  void use(const robot::RobotModel& robot, std::int64_t version);

  void begin_mission() { equations_.take(); }
  // Samples of the mission in order of time, without those at a charger, and the climb there.
  void add(const signals::Sample& sample, double climb_rad) { equations_.add(sample, climb_rad); }
  void interrupt() { equations_.interrupt(); }

  struct Judgement {
    std::string findings_json;  // for the mission's record; empty: its motion gives no evidence
    std::string
        payload_event_json;  // empty: the payload was as declared, or is not distinguished from the rest
    std::optional<Contradiction> payload_unit;  // the declared payloads of the newest missions together
  };
  // Every second mission is evaluated and excluded from training, so that a back-test has missions to use.
  Judgement end_mission(const history::Mission& mission);

  // The robot's last change: from there on it is refined.
  void set_change(const std::optional<drift::Mark>& change);
  // A model that may be better than the one in force, to be back-tested; its time is the caller's to set.
  std::optional<history::Proposal> suggestion();

  std::string memory_json() const;
  void recall(const std::string& text);  // text that is no memory changes nothing

 private:
  // The carried payload over the declared one, and that of an unloaded robot.
  struct PayloadLine {
    double slope, slope_sd, unloaded_kg, unloaded_sd_kg;
  };
  PayloadLine payload_line() const;
  static std::optional<Contradiction> payload_unit(const PayloadLine& line);
  void begin_tests() { progress_.tests = progress_.tested_at = 0; }

  robot::RobotModel robot_;
  std::int64_t version_;
  energy::DriveEquations equations_;
  energy::Refinement refinement_;
  RefinementProgress progress_;
};

}  // namespace joulecast::ingest
