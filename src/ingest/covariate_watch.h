#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynamics/climb.h"
#include "dynamics/parameters.h"
#include "history/records.h"
#include "ingest/counters.h"
#include "signals/covariates.h"
#include "signals/gaps.h"
#include "signals/sample.h"
#include "telemetry/covariate_tracker.h"
#include "telemetry/recording.h"

namespace joulecast::ingest {

// One robot's covariates: present values, the open mission's values that are to be stored, and the climb
// computed from pitch or height.
class CovariateWatch {
 public:
  // Takes a message with a plausible clock; `fault` is called with every value refused, and why.
  using Fault = std::function<void(IngestFault, std::string why)>;
  void take(const signals::CovariateMessage& message, const Fault& fault);

  // As CovariateTracker's.
  std::string label_of(std::string_view quantity) const { return tracker_.label_of(quantity); }

  // Present values apply in the mission from its start.
  void begin_mission(std::int64_t start_utime_us);
  void end_mission() { in_mission_ = false; }
  // Goes on with a mission that an earlier run of the daemon began.
  void resume(const history::Mission& mission);

  // Changes of the open mission that settle() has not handed over.
  std::size_t pending() const { return pending_.size(); }
  // Updates the record's summaries to its end and returns the changes since the last call.
  std::vector<signals::CovariateChange> settle(history::Mission& record);

  // The climb at the next sample in order of time.
  double climb_at(const dynamics::Parameters<double>& parameters, const signals::Sample& sample,
                  signals::Step step);
  // The robot's clock was set: present values continue in the new time.
  void on_clock_step(std::int64_t utime_us);

 private:
  void note(signals::CovariateChange change);
  void hear_height(std::int64_t utime_us, double height_m);

  telemetry::CovariateTracker tracker_;
  bool in_mission_ = false;
  std::vector<history::CovariateSummary> summaries_;  // of the open mission
  std::vector<signals::CovariateChange> pending_;
  telemetry::ClimbReader reader_;
  dynamics::ClimbTracker climb_;
  std::deque<std::pair<std::int64_t, double>> heights_;  // of times that no sample has reached
  double height_m_ = signals::unmeasured;
};

}  // namespace joulecast::ingest
