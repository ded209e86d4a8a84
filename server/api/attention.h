#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/store.h"

namespace joulecast::api {

class RequestChange;
struct Services;

// The most urgent first: data are wrong or missing; a robot or a model needs a person; information.
enum class Severity { fault, warning, notice };
inline constexpr std::string_view severity_names[] = {"fault", "warning", "notice"};

struct Acknowledgement {
  std::int64_t utime_us = 0;
  std::string by;  // name of a token; empty: anonymous
  std::string note;
};

// A condition that a person should act on, present now.
struct AttentionReason {
  std::string kind;  // one of attention.cc's kinds
  Severity severity = Severity::notice;
  std::optional<std::int64_t> since_utime_us;  // absent if unknown
  std::string message;                         // one sentence: the condition with its number
  std::string action;                          // one sentence: what to do about it
  std::string subject = {};                    // distinguishes conditions of one kind
  std::optional<Acknowledgement> acknowledged = {};

  bool same(const AttentionReason& other) const { return kind == other.kind && subject == other.subject; }
};

struct AttentionEntry {
  std::string robot_id;                  // empty: the service itself
  std::vector<AttentionReason> reasons;  // at least one; unacknowledged ones first, then the most urgent
};

// Everything that needs attention now: contradicted telemetry, silence that began during a mission, charge
// below the file's reserve, a missing robot file, drift, departure from robots of the same kind, an effect
// found by a diagnosis, an open proposal, and faults of the store and the cluster.
//
// The reasons of a robot with their beginnings and acknowledgements are stored with it. The events
// "robot_silent", "robot_back", "charge_low", "charge_restored" and "contradiction_ended" are those of the
// robots that this daemon keeps.
class AttentionList {
 public:
  // `is_own`: see WatchOptions. The list outlives no member of `services`.
  AttentionList(const Services& services, std::function<bool(const std::string& robot_id)> is_own,
                std::function<void(const Error&)> on_error)
      : services_(services), is_own_(std::move(is_own)), on_error_(std::move(on_error)) {}

  // Looks once a second, in a thread of its own, until stop().
  void start();
  void stop() { thread_ = {}; }

  // Unacknowledged ones first, then the most urgent, then by robot id.
  std::vector<AttentionEntry> entries() const;

  // Acknowledges the robot's reasons of the kind until they end, by `change`, whose answer is the
  // robot's entry. Fault::not_found of "kind" if the robot has no such reason.
  history::Outcome acknowledge(const std::string& robot_id, std::string_view kind, const Acknowledgement& by,
                               RequestChange& change);

 private:
  using Reasons = std::map<std::string, std::vector<AttentionReason>>;  // by robot; of the service: ""
  void look();
  Reasons found();
  void merge(const std::string& robot_id, std::vector<AttentionReason> old,
             std::vector<AttentionReason>& now);
  std::vector<AttentionReason> remembered(const std::string& robot_id) const;
  bool has_ended(const std::string& robot_id, const AttentionReason& reason) const;
  void record(const std::string& robot_id, const AttentionReason& reason, bool begins);

  const Services& services_;
  const std::function<bool(const std::string& robot_id)> is_own_;
  const std::function<void(const Error&)> on_error_;
  Reasons findings_;  // diagnoses and proposals, as last read
  std::optional<std::chrono::steady_clock::time_point> read_at_;
  std::mutex changing_;  // held while what is stored changes
  mutable std::mutex mutex_;
  Reasons shown_;
  std::jthread thread_;
};

}  // namespace joulecast::api
