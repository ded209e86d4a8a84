#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "history/records.h"
#include "telemetry/datagram.h"

namespace joulecast::ingest {

// Kinds of faults in a robot's telemetry: labels of the metrics.
enum class ContradictionKind : std::size_t {
  sign,         // reversed, or without its sign
  scale,        // another unit
  sides,        // right and left swapped
  dead,         // 0 all the time
  constant,     // one value all the time
  limit,        // beyond the robot file's limits
  corrupt,      // readings that are thrown for a sample
  implausible,  // values or messages that no robot sends
  clock,
  sequence,
  sender,   // two under one robot id
  identity  // messages of another robot's id
};
inline constexpr std::size_t contradiction_kind_count = 12;
inline constexpr std::array<std::string_view, contradiction_kind_count> contradiction_kind_names = {
    "sign",    "scale",       "sides", "dead",     "constant", "limit",
    "corrupt", "implausible", "clock", "sequence", "sender",   "identity"};

// A channel that is contradicted by the robot's other channels, its robot file or the service's clock.
struct Contradiction {
  ContradictionKind kind = ContradictionKind::implausible;
  std::string id;       // "battery_current_reversed", "wheel_velocity_scale", "second_sender", ...
  std::string channel;  // fields of robot_telemetry_t; empty: none
  double value = 0;     // the evidence: a ratio, a share of the messages
  std::string says;     // the finding, its likely cause, and the expected value
  // The accounts of a mission with this contradiction are wrong: the mission is not used for training.
  bool untrue = false;
  std::int64_t told_utime_us = 0;  // host's, when it was last reported as an event

  bool same(const Contradiction& other) const { return id == other.id && channel == other.channel; }
};

// Why a message, a sample or an event was refused or repaired. Each has one counter for the daemon and
// one in the mission it happened in; names are labels of the metrics and keys of a mission's `sample_faults`.
enum class IngestFault : std::size_t {
  undecodable,      // the guard or the decoder refused the bytes
  wrong_channel,    // the message's robot_id is not its channel's
  queue_full,       // the bounded queue between receiving and accounting was full
  too_many_robots,  // of unknown robots beyond the stored ones
  unknown_robot,    // no model: its samples are not accounted
  implausible,      // a value is missing, infinite or absurd
  impossible,       // a reading that this robot cannot have; the sample is accounted for without it
  duplicate,        // a sample or a mission event
  late,             // out of order, older than the last accounted sample or a covariate's present value
  missing,          // sequence numbers that never came (or came late)
  restart,          // the robot's sequence restarted
  clock_backward,
  clock_forward,
  clock_ahead,        // stamped well after the daemon's time; accounted for all the same
  too_far_ahead,      // stamped further after the daemon's time than the setting allows; not accounted for
  too_fast,           // after its clock was set, more time than has passed by the daemon's; not accounted for
  unsigned_message,   // not signed, where the robot or all robots have to
  bad_signature,      // the signature is not that of the robot's key
  replayed,           // signed properly, but sent before, or at another time
  second_sender,      // another sender under the robot's id; not accounted for
  gap,                // a silence too long to be bridged
  zero_payload,       // payload 0 though the mission's start declared a load, which is accounted for
  outside_mission,    // belongs to no mission: just after an end, or before a start
  bad_event,          // out-of-order or unknown mission event
  event_flood,        // more mission events than the setting allows
  empty_mission,      // ended before its first sample; not stored
  reused_mission_id,  // a mission began under an id that an earlier one had
  too_many_covariates,  // a value of a name beyond those that a mission may have
  solver                // ERKStep failed on an interval; its chord stood in
};
inline constexpr std::size_t ingest_fault_count = 29;

inline constexpr std::array<std::string_view, ingest_fault_count> ingest_fault_names = {
    "undecodable",   "wrong_channel", "queue_full",        "too_many_robots",
    "unknown_robot", "implausible",   "impossible",        "duplicate",
    "late",          "missing",       "restart",           "clock_backward",
    "clock_forward", "clock_ahead",   "too_far_ahead",     "too_fast",
    "unsigned",      "bad_signature", "replayed",          "second_sender",
    "gap",           "zero_payload",  "outside_mission",   "bad_event",
    "event_flood",   "empty_mission", "reused_mission_id", "too_many_covariates",
    "solver"};

inline std::string name_of(IngestFault fault) {
  return std::string(ingest_fault_names[static_cast<std::size_t>(fault)]);
}

// Why an ended mission is not used for training.
enum class LeftOut : std::size_t {
  contradicted,    // its channels contradict each other, the robot file or the clock
  barely_measured  // the battery was measured for less than half of its time
};
inline constexpr std::size_t left_out_count = 2;
inline constexpr std::array<std::string_view, left_out_count> left_out_names = {"contradicted",
                                                                                "barely_measured"};

// Written by the ingest threads, read by the metrics.
struct IngestCounters {
  std::atomic<std::uint64_t> messages = 0;                       // received on the channels of the contract
  std::atomic<std::uint64_t> samples = 0;                        // accounted for
  std::atomic<std::uint64_t> covariate_changes = 0;              // of missions
  std::array<std::atomic<std::uint64_t>, 2> missions_started{};  // announced, implicit
  std::array<std::atomic<std::uint64_t>, history::mission_state_count> missions_ended{};  // by state
  std::array<std::atomic<std::uint64_t>, ingest_fault_count> faults{};
  std::array<std::atomic<std::uint64_t>, contradiction_kind_count> contradictions{};  // reported
  std::array<std::atomic<std::uint64_t>, left_out_count> missions_left_out{};
  telemetry::DatagramCounters datagrams;

  void add(IngestFault fault, std::uint64_t count = 1) { faults[static_cast<std::size_t>(fault)] += count; }
};

}  // namespace joulecast::ingest
