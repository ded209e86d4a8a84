#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "signals/covariates.h"
#include "signals/ledger.h"
#include "signals/sample.h"

// The store's records. Times are microseconds since the Unix epoch (the robot's clock for missions, traces
// and samples; the daemon's for versions and events). NaN = not measured or not declared; stored as NULL.
namespace joulecast::history {

// Surrogate key of a mission: positive, never reused within one store. 0 names no mission.
using MissionKey = std::int64_t;

// The names of an enumeration's values, in their order; see name() and from_name().
template <class Enum>
inline constexpr std::array<std::string_view, 0> names_of{};

enum class ModelOrigin { file, http, calibration, diagnosis };
template <>
inline constexpr std::array<std::string_view, 4> names_of<ModelOrigin>{"file", "http", "calibration",
                                                                       "diagnosis"};

// One immutable version of a robot's model.
struct ModelVersion {
  std::string robot_id;
  std::int64_t version = 0;  // 1, 2, 3 ... within the robot
  std::int64_t created_utime_us = 0;
  ModelOrigin origin = ModelOrigin::file;
  std::string note;
  std::optional<std::int64_t> parent_version;  // the version that was active when this one was added
  bool active = false;
  std::string model_json;     // the robot file's text, byte for byte as added
  std::string evidence_json;  // evidence for its adoption: back-test and origin; empty: none given
};

struct RobotRecord {
  std::string robot_id;
  std::int64_t created_utime_us = 0;
  std::optional<std::int64_t> active_version;  // absent: the robot has sent telemetry, but has no model
};

enum class MissionState {
  open,        // samples may still come
  finished,    // reported by the robot
  aborted,     // reported by the robot
  unfinished,  // the robot fell silent before it reported either
  superseded,  // the robot started another mission without ending this one
  interrupted  // the daemon was down while it ran
};
inline constexpr std::size_t mission_state_count = 6;
template <>
inline constexpr std::array<std::string_view, mission_state_count> names_of<MissionState>{
    "open", "finished", "aborted", "unfinished", "superseded", "interrupted"};

// Summary of one covariate over a mission, in its own unit.
struct CovariateSummary {
  std::string name;
  double mean = signals::unmeasured;  // over the time with a value; of a label the share of that time with it
  double min = signals::unmeasured;
  double max = signals::unmeasured;
  double known_s = 0;                  // the mean counts over so long, up to counted_utime_us
  std::int64_t counted_utime_us = 0;   // robot's clock
  double value = signals::unmeasured;  // the last one
  std::int64_t value_utime_us = 0;     // from which on it holds
};

struct Mission {
  MissionKey key = 0;
  std::string robot_id;
  std::string mission_id;  // the robot's name for it; unique only together with robot_id and start
  std::int64_t start_utime_us = 0;
  std::int64_t end_utime_us = 0;  // of an open mission: the last sample accounted for
  MissionState state = MissionState::open;
  bool implicit = false;          // began with a sample, not with a mission event
  bool incomplete = false;        // a part of it was not measured: its energy is a lower bound
  std::string incomplete_reason;  // empty when complete
  double payload_kg = signals::unmeasured;
  std::string note;
  std::optional<std::int64_t> model_version;  // of robot_id; absent when the robot's model was unknown
  signals::Accounts accounts;
  std::int64_t samples = 0;                           // accepted and accounted for
  std::map<std::string, std::int64_t> sample_faults;  // reason -> samples counted out or repaired
  std::int64_t gap_count = 0;
  double gap_s = 0;  // time without samples, bridged or not
  // A JSON object; empty: none. Findings on payload and friction from its motion, or "contradictions": why
  // its accounts are wrong. "annulled": when and why a user excluded it from all sums.
  std::string findings_json;
  std::vector<CovariateSummary> covariates;
};

// The parts of findings_json, as JSON each.
struct MissionFindings {
  std::string motion;  // empty: none
  std::string contradictions = "[]";
  std::string annulled;  // empty: not annulled

  // Whether the mission may be used for training.
  bool teaches() const { return contradictions == "[]" && annulled.empty(); }
};
[[nodiscard]] MissionFindings findings_of(const Mission& mission);
// The mission's findings_json once it is annulled. `reason` is any UTF-8 text.
[[nodiscard]] std::string annulled_findings(const Mission& mission, std::int64_t utime_us,
                                            const std::string& reason);

// Least, mean and greatest of a quantity; all NaN when it was not measured.
struct Band {
  double min = signals::unmeasured;
  double mean = signals::unmeasured;  // over time
  double max = signals::unmeasured;
};

inline constexpr std::int64_t trace_bucket_us = 1'000'000;

// A mission over [start, start + width): width is trace_bucket_us as stored, a multiple of it downsampled.
struct TraceBucket {
  std::int64_t start_utime_us = 0;  // a multiple of trace_bucket_us since the epoch
  double covered_s = 0;             // time within the bucket that samples cover: the weight of its means
  Band measured_power_w;            // out of the battery positive
  Band modelled_power_w;
  Band speed_m_s;
  double state_of_charge = signals::unmeasured;  // the latest known in the bucket, 0 to 1
  double measured_j = signals::unmeasured;       // since the mission's start, at the bucket's end
  double modelled_j = signals::unmeasured;       // since the mission's start, at the bucket's end
  double x_m = signals::unmeasured;              // mean position
  double y_m = signals::unmeasured;
};

struct Trace {
  std::int64_t width_us = trace_bucket_us;
  std::vector<TraceBucket> buckets;  // by start; buckets without samples are absent
};

// State of a robot that a restarted daemon needs to continue.
struct ResumeState {
  std::string robot_id;
  std::int64_t utime_us = 0;  // of the last sample accounted for
  std::int64_t sequence = 0;  // of the last sample accounted for
  double state_of_charge = signals::unmeasured;
  std::array<double, 2> winding_temperature_c{signals::unmeasured, signals::unmeasured};
};

// Training state of a robot under one topic.
struct Learned {
  std::string robot_id;
  std::string topic;  // e.g. "charge"
  std::int64_t utime_us = 0;
  std::string body_json = "{}";
};

// An entry of the audit: a change or a refusal, and its actor. Entries are chained, see history/audit.h.
struct AuditEntry {
  std::int64_t id = 0;  // 1, 2, 3 ...; given by the store
  std::int64_t utime_us = 0;
  std::string actor;       // name of a token; empty: anonymous
  std::string address;     // IP address of the client; empty: the daemon itself
  std::string request_id;  // empty: no request
  std::string action;      // operation id of the request, or another event, e.g. "token_added"
  std::string detail_json = "{}";
  std::string hash;  // given by the store
};

// The answer that a request with an idempotency key got, for when it is repeated.
struct RequestAnswer {
  std::string actor;        // name of a token; empty: anonymous
  std::string key;          // Idempotency-Key of the request
  std::string fingerprint;  // of the request: another one under the same key differs
  std::int64_t utime_us = 0;
  std::int64_t status = 0;  // of HTTP
  std::string location;     // its Location header; empty: none
  std::string body;

  friend bool operator==(const RequestAnswer&, const RequestAnswer&) = default;
};

// The plan of one level of a map: an image, placed as ROS's map.yaml places one.
struct FloorPlan {
  std::string map, level;
  std::int64_t utime_us = 0;  // of the upload
  double resolution_m = 0;    // side of a pixel
  // The lower left corner of the image in the map.
  double origin_x_m = 0, origin_y_m = 0, origin_yaw_rad = 0;
  std::vector<std::array<double, 2>> chargers;  // x and y, m
  std::string media_type;
  std::string image;
};

// An event in the fleet; events are in the order in which they were stored.
struct Event {
  std::int64_t id = 0;  // increasing in order of commit; given by the store
  std::int64_t utime_us = 0;
  std::string robot_id;  // empty: concerns no single robot
  std::string kind;      // e.g. "mission_finished", "model_added"
  std::string detail_json = "{}";
};

enum class DiagnosisState { queued, running, done, failed, cancelled, interrupted };
template <>
inline constexpr std::array<std::string_view, 6> names_of<DiagnosisState>{
    "queued", "running", "done", "failed", "cancelled", "interrupted"};
constexpr bool has_ended(DiagnosisState state) {
  return state != DiagnosisState::queued && state != DiagnosisState::running;
}

enum class DiagnosisCause { request, watch };
template <>
inline constexpr std::array<std::string_view, 2> names_of<DiagnosisCause>{"request", "watch"};

// A diagnosis of a robot's gap: the job and, when done, its result.
struct DiagnosisRecord {
  std::int64_t id = 0;  // increasing; given by the store
  std::string robot_id;
  std::int64_t created_utime_us = 0;
  std::optional<std::int64_t> started_utime_us;
  std::optional<std::int64_t> finished_utime_us;
  DiagnosisState state = DiagnosisState::queued;
  DiagnosisCause cause = DiagnosisCause::request;
  std::string request_json = "{}";
  std::optional<std::int64_t> model_version;  // the model that was diagnosed
  std::vector<MissionKey> fitted_on;
  std::vector<MissionKey> held_back;  // left for a back-test
  std::string result_json;            // empty: none
  std::string summary_json;           // summary of the result for lists; empty: none
  std::string model_json;             // the robot file with the effects found; empty: nothing to adopt
  std::string error;                  // of a failed one
};

enum class ProposalState { open, adopted, dismissed, superseded };
template <>
inline constexpr std::array<std::string_view, 4> names_of<ProposalState>{"open", "adopted", "dismissed",
                                                                         "superseded"};

// A model that something suggests, to be adopted or dismissed by an operator.
struct Proposal {
  std::int64_t id = 0;  // increasing; given by the store
  std::string robot_id;
  std::int64_t created_utime_us = 0;
  std::string kind;  // e.g. "calibration"
  ProposalState state = ProposalState::open;
  std::string note;
  std::optional<std::int64_t> base_version;     // the model that it changes
  std::optional<std::int64_t> adopted_version;  // the version that it became
  std::vector<MissionKey> fitted_on;            // missions that a back-test must leave out
  std::string model_json;
  std::string detail_json = "{}";  // details from the program that made it
};

template <class Enum>
concept Named = !names_of<Enum>.empty();

template <Named Enum>
constexpr std::string_view name(Enum value) {
  return names_of<Enum>.at(static_cast<std::size_t>(value));
}
template <Named Enum>
std::optional<Enum> from_name(std::string_view text) {
  const auto found = std::ranges::find(names_of<Enum>, text);
  if (found == names_of<Enum>.end()) return std::nullopt;
  return static_cast<Enum>(found - names_of<Enum>.begin());
}

}  // namespace joulecast::history
