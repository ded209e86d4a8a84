#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "energy/refinement.h"
#include "history/records.h"
#include "ingest/contradiction.h"
#include "robot/robot_model.h"
#include "signals/sample.h"

namespace joulecast::ingest {

// Refines one robot's friction and idle power from its missions as they come, reports payloads that were not
// declared, and proposes a new model version when the refined one departs from that in force.
class RefinementWatch {
 public:
  // The model must be one that the catalogue of effects accepts.
  RefinementWatch(const robot::RobotModel& robot, std::int64_t version);

  // Another version of the robot's model came in force; between missions.
  void use(const robot::RobotModel& robot, std::int64_t version);

  void begin_mission();
  // Samples of the mission in order of time, without those at a charger, and the climb there.
  void add(const signals::Sample& sample, double climb_rad) { equations_.add(sample, climb_rad); }
  void interrupt() { equations_.interrupt(); }

  struct Judgement {
    std::string findings_json;  // for the mission's record; empty: its motion gives no evidence
    std::string
        payload_event_json;  // empty: the payload was as declared, or is not distinguished from the rest
    std::optional<history::Proposal> proposal;  // its time is the caller's to set
    std::optional<Contradiction> payload_unit;  // the declared payloads of the newest missions together
  };
  // Every third mission is evaluated and excluded from training, so that a back-test has missions to use.
  Judgement end_mission(const history::Mission& mission);

  std::string memory_json() const;
  void recall(const std::string& text);  // text that is no memory changes nothing

 private:
  bool worth_proposing() const;
  std::optional<Contradiction> payload_unit() const;
  history::Proposal proposal() const;

  robot::RobotModel robot_;
  std::int64_t version_;
  energy::DriveEquations equations_;
  energy::Refinement refinement_;
  std::int64_t judged_ = 0;
  // Of the carried payload over the declared one, over missions, weighted: 1, x, y, x x, x y; the newest ten
  // count most.
  std::array<double, 5> payload_sums_{};
  std::size_t proposed_at_ = 0;  // missions used for training at the last proposal
  std::vector<history::MissionKey> learned_from_;
};

}  // namespace joulecast::ingest
