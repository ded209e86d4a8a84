#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/api/services.h"

namespace joulecast::api {

// The most urgent first: data are wrong or missing; a robot or a model needs a person; information.
enum class Severity { fault, warning, notice };

// A condition that a person should act on, present now.
struct AttentionReason {
  std::string_view kind;  // "contradicted", "silent", "charge_low", ...
  Severity severity = Severity::notice;
  std::optional<std::int64_t> since_utime_us;  // absent if unknown
  std::string message;                         // one sentence: the condition with its number
  std::string action;                          // one sentence: what to do about it
};

struct AttentionEntry {
  std::string robot_id;                  // empty: the service itself
  std::vector<AttentionReason> reasons;  // at least one, the most urgent first
};

// Everything that needs attention now, the most urgent first, then by robot id: contradicted telemetry,
// silence during a mission, charge below the file's reserve, a missing robot file, drift, departure from
// robots of the same kind, an effect found by a diagnosis, an open proposal, and faults of the store and the
// cluster.
Result<std::vector<AttentionEntry>> attention(const Services& services);

}  // namespace joulecast::api
