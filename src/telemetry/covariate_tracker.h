#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "signals/covariates.h"

namespace joulecast::telemetry {

// One robot's covariates as its messages arrive: which of their values are changes, and which apply when a
// mission begins. Stores max_covariates names at most.
class CovariateTracker {
 public:
  enum class Verdict {
    news,     // the value changed
    repeat,   // it is the one that holds
    late,     // older than the one that holds
    no_room,  // a name beyond max_covariates
  };

  // Takes one value of a message; `change` is set where it is news. Within a mission no change is earlier
  // than the mission's start.
  Verdict take(std::int64_t utime_us, const signals::Covariate& covariate, signals::CovariateChange& change);

  // A mission begins: returns the present values, as changes at its start. Removes names without a value.
  std::vector<signals::CovariateChange> begin_mission(std::int64_t start_utime_us);

  // The label of the quantity that holds, e.g. "ice" of "surface=ice"; empty: none. Of several the newest.
  std::string label_of(std::string_view quantity) const;

  // Restores the values that applied when an earlier run of the program stopped within a mission.
  void resume(std::int64_t mission_start_utime_us, std::span<const signals::CovariateChange> held);

 private:
  struct Held {
    std::int64_t utime_us = 0;
    double value = signals::unmeasured;
  };

  // A value that is older than the current one by more than this shows a clock set back, and is news.
  static constexpr std::int64_t reorder_us = 5'000'000;

  std::int64_t mission_start_us_ = INT64_MIN;
  std::map<std::string, Held, std::less<>> held_;
};

}  // namespace joulecast::telemetry
