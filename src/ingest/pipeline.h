#pragma once

#include <boost/core/noncopyable.hpp>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "ingest/inbound_message.h"
#include "ingest/keeping.h"
#include "ingest/robot_session.h"
#include "ingest/stored_robot.h"

namespace joulecast::ingest {

// Accepts messages from one sender per robot. A second sender under the robot's id is distinguished by its
// address or, behind one address, by its own stream of sequence numbers. Its messages wait. They are rejected
// when the first sender sends again, so that no energy is counted twice; they pass when the first one has
// fallen silent, so that a robot with a restarted publisher or a changed address loses no data. Messages of
// unknown senders (logs) have the streams only.
class SenderGate : boost::noncopyable {
 public:
  // `takeover_us`: silence after which another sender takes over at the latest. `room`: units (about one
  // sample) that may wait in all gates together.
  SenderGate(std::int64_t takeover_us, std::size_t& room) : takeover_us_(takeover_us), room_(room) {}
  ~SenderGate() { drop_waiting(); }

  struct Verdict {
    std::vector<InboundMessage> released = {};  // pass first
    bool pass = false;                          // the message itself; else it waits or is refused
    std::size_t refused = 0;                    // it and such that waited
  };
  Verdict take(const InboundMessage& message);
  // Returns messages that have waited long enough; all of them when `now` is the end of time.
  std::vector<InboundMessage> release(std::int64_t host_utime_us);

  // The rejected sender and the accepted one.
  std::string describe() const;

 private:
  struct Stream {
    std::int64_t sequence = -1, utime_us = 0;
    // Sequence numbers count up and clocks agree.
    bool continued_by(const signals::Sample& sample) const;
  };

  Verdict take_first(const InboundMessage& message, const signals::Sample* sample);
  Verdict take_other(const InboundMessage& message);
  bool is_of_first(const InboundMessage& message, const signals::Sample* sample) const;
  bool is_second_stream(const signals::Sample& sample, std::int64_t host_utime_us);
  std::int64_t patience_us(std::int64_t host_utime_us) const;
  std::size_t drop_waiting();

  std::int64_t takeover_us_;
  std::size_t& room_;
  telemetry::Sender first_, other_;
  telemetry::Sender
      announcer_;  // of the last event; where it is first_, no other sender is expected to announce missions
  bool any_ = false;                    // first_ is set
  std::int64_t heard_us_ = 0;           // of first_
  double interval_us_ = 0;              // between its messages
  std::int64_t contested_us_ = 0;       // when both were last received; 0: never
  std::deque<InboundMessage> waiting_;  // of other_, since the last message of first_
  std::size_t waiting_units_ = 0;
  Stream main_, side_;
  int returns_ = 0;  // to a stream that was left, lately
  std::int64_t returned_us_ = 0;
};

// Decoded messages in, history out: one session a robot that has a model, in one thread. Of other ids only
// messages are counted, of a bounded number of ids. The daemon and the offline replay run this same code.
class Pipeline {
 public:
  // `keeping`: which robots this daemon of a cluster keeps; null: all. `held_room_bytes`: for messages of the
  // robots that others keep.
  Pipeline(const SessionSettings& settings, std::size_t max_unknown_robots, const ModelRegistry& models,
           SessionOutputs outputs, Keeping* keeping = nullptr, std::size_t held_room_bytes = 300'000'000);

  // Opens sessions for the missions that were open when the last daemon stopped. In a cluster leases do.
  Result<void> recover();

  // From now on the store is read in a thread of its own: a robot's messages wait until its state was read.
  void start_reading() { reader_.start(); }

  // Takes up robots that were read or that this daemon of a cluster keeps now, releases others. Call often.
  void follow_orders();

  void handle(const InboundMessage& message);

  // Call about once a second.
  void tick(std::int64_t host_utime_us);
  // The host's clock was set: silence is counted on as if it had not been.
  void on_host_clock_step(std::int64_t host_utime_us, std::int64_t step_us);
  // Publishes the snapshots that changed.
  void publish();
  // Ends missions as if the robots had fallen silent permanently; for offline replay.
  void finish();
  // Checkpoints all open missions, to be resumed by the next daemon, and releases the leases.
  void suspend();

 private:
  struct Robot {
    RobotSession session;
    SenderGate gate;
    bool had_model = false;
  };
  struct UnknownRobot {
    RobotSnapshot snapshot;
    bool changed = true;
  };

  Robot* find(const std::string& robot_id);
  // Adds the requests of the robot to its messages, in order of time; those with an effect that its latest
  // mission has are only noted.
  static void merge(const StoredRobot& stored, Robot& robot, std::deque<InboundMessage>& messages);
  Robot& add(const StoredRobot& stored, const SessionOutputs& outputs);
  Result<StoredRobot> read(const std::string& robot_id) const;
  // Asks for a robot's state in the store; until take_read() its messages are held.
  void want(const std::string& robot_id, history::Epoch epoch = 0);
  void take_read();
  void deliver(Robot& robot, const InboundMessage& message);
  // In a cluster of robots without a model, too: it may come to this daemon after their first messages.
  void hold(const InboundMessage& message, bool has_model);
  // `grant`: in a cluster.
  void take_up(const StoredRobot& stored, const Keeping::Grant* grant);
  void let_go(const Keeping::Withdrawal& withdrawal);
  void suspend(Robot& robot) const;
  SessionOutputs outputs_under(history::Epoch epoch) const;
  static void deliver(RobotSession& session, const InboundMessage& message);
  void count_unknown_robot(const InboundMessage& message);
  // Makes room for another unknown robot by discarding one that has long been silent.
  bool discard_unknown_robot(std::int64_t host_utime_us);
  void refresh_models();

  SessionSettings settings_;
  std::size_t max_unknown_robots_;
  const ModelRegistry& models_;
  SessionOutputs outputs_;
  std::uint64_t epoch_ = 0;
  std::size_t waiting_room_;  // of all gates
  std::map<std::string, std::unique_ptr<Robot>, std::less<>> robots_;
  std::map<std::string, UnknownRobot, std::less<>> unknown_robots_;
  Keeping* keeping_;
  HeldMessages held_;
  std::map<std::string, history::Epoch, std::less<>> reading_;  // robots that wait for the reader
  RobotReader reader_;
  Keeping::Leases leases_;               // as last read
  std::vector<Keeping::Grant> granted_;  // to be taken up
  std::int64_t forgot_utime_us_ = 0, told_utime_us_ = 0;
};

// Reports that a mission began under the name of an earlier one: missions are looked up by their names. For
// the outcomes of history::StartMission; any thread.
void report_reused_name(const history::Mission& begun, history::MissionKey earlier,
                        std::int64_t host_utime_us, IngestCounters& counters,
                        const std::function<void(history::Command)>& post);

}  // namespace joulecast::ingest
