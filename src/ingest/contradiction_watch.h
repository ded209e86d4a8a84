#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/drive_model.h"
#include "ingest/counters.h"
#include "plausibility/observation.h"
#include "robot/robot_model.h"
#include "signals/sample.h"

namespace joulecast::ingest {

// Whether the battery's channels are contradicted in their state of charge; not faults of single samples.
bool doubts_battery(const std::vector<Contradiction>& contradictions);

// Compares one robot's channels with each other and with its robot file while its missions run (gap/checks),
// and counts faults of its messages. Work and memory per sample are constant; the channels are compared after
// some hundred samples of a mission, each time its length has doubled, and at its end.
class ContradictionWatch {
 public:
  // `drive`: of that robot.
  ContradictionWatch(const robot::RobotModel& robot, const dynamics::DriveModel& drive);

  // A message of the robot, before it is checked.
  void hear(std::uint64_t messages = 1);
  // Counts faulty messages among them, with a description.
  void hear(IngestFault fault, std::uint64_t count, const std::string& why);

  void begin_mission(const std::string& mission_id, double payload_kg);
  void add(const signals::Sample& sample);  // accounted for, in order
  // The open mission as a whole is contradicted, by something that is seen once.
  void doubt_mission(Contradiction why);
  // The contradiction of several missions together, if any; until the next call.
  void doubt_missions(std::optional<Contradiction> why);
  // The contradictions of the mission as a whole.
  std::vector<Contradiction> end_mission();

  // Those of the newest messages and of the mission; of the last mission until this one is long enough.
  std::vector<Contradiction> all() const;
  // The contradictions of the last mission, also of that before a restart; until another one is long enough.
  void recall(std::vector<Contradiction> of_last_mission) { keep_channels(std::move(of_last_mission)); }
  // Whether all() has changed since the last call.
  bool take_changed() { return std::exchange(changed_, false); }
  // Whether the battery's channels are contradicted.
  bool doubts_battery() const { return doubts_battery_; }

 private:
  void judge_messages();
  void judge_channels(std::vector<Contradiction> found, bool replace);
  void keep_channels(std::vector<Contradiction> found);

  robot::RobotModel robot_;
  plausibility::Observer observer_;
  std::vector<Contradiction> of_messages_, of_channels_, of_mission_;
  std::optional<Contradiction> of_missions_;
  std::vector<Contradiction> untrue_messages_;  // since the mission began
  std::array<std::uint64_t, ingest_fault_count> faults_{};
  std::array<std::string, ingest_fault_count> why_;
  std::uint64_t messages_ = 0;  // of the window that faults_ count
  bool is_decided_ = false;     // its share is certain
  std::uint64_t samples_ = 0, next_ = 0;
  bool in_mission_ = false, changed_ = false, doubts_battery_ = false;
};

}  // namespace joulecast::ingest
