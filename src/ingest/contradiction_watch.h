#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/drive_model.h"
#include "gap/checks/observation.h"
#include "ingest/contradiction.h"
#include "ingest/counters.h"
#include "robot/robot_model.h"
#include "signals/sample.h"

namespace joulecast::ingest {

// Whether what the battery's channels say of the charge is contradicted; single samples are no reason to.
bool doubts_battery(const std::vector<Contradiction>& contradictions);

// Holds one robot's channels against each other and against its file while its missions run (gap/checks), and
// counts what is wrong with its messages. Work and memory a sample do not grow; the channels are compared
// after some hundred samples of a mission, then whenever it has become twice as long, and at its end.
class ContradictionWatch {
 public:
  // `drive`: of that robot.
  ContradictionWatch(const robot::RobotModel& robot, const dynamics::DriveModel& drive);

  // A message of the robot, before anything is known of it.
  void hear(std::uint64_t messages = 1);
  // That something was wrong with messages among them, and what.
  void hear(IngestFault fault, std::uint64_t count, const std::string& why);

  void begin_mission(const std::string& mission_id, double payload_kg);
  void add(const signals::Sample& sample);  // accounted for, in order
  // The open mission as a whole is contradicted, by something that is seen once.
  void doubt_mission(Contradiction why);
  // The contradictions of the mission as a whole.
  std::vector<Contradiction> end_mission();

  // Those of the newest messages and of the mission, or until it says enough, of the last one.
  std::vector<Contradiction> all() const;
  // Those of the last mission before a restart, which stand until another one says enough.
  void recall(std::vector<Contradiction> of_last_mission);
  // Whether that has changed since it was last asked.
  bool take_changed();
  // What the battery's channels say is contradicted.
  bool doubts_battery() const { return doubts_battery_; }

 private:
  void judge_messages();
  void judge_channels(std::vector<Contradiction> found, bool replace);
  void keep_channels(std::vector<Contradiction> found);

  robot::RobotModel robot_;
  gap::Observer observer_;
  std::vector<Contradiction> of_messages_, of_channels_, of_mission_;
  std::vector<Contradiction> untrue_messages_;  // since the mission began
  std::array<std::uint64_t, ingest_fault_count> faults_{};
  std::array<std::string, ingest_fault_count> why_;
  std::uint64_t messages_ = 0;  // of the window that faults_ count
  bool is_decided_ = false;     // its share is certain
  std::uint64_t samples_ = 0, next_ = 0;
  bool in_mission_ = false, changed_ = false, doubts_battery_ = false;
};

}  // namespace joulecast::ingest
