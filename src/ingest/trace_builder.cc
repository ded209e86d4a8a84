#include "ingest/trace_builder.h"

#include <utility>

namespace joulecast::ingest {

void TraceBuilder::begin() {
  finished_.clear();
  open_.reset();
  touched_ = false;
}

void TraceBuilder::add(const energy::MeterPoint& point, const signals::Accounts& accounts,
                       double state_of_charge) {
  const std::int64_t start = point.sample.utime_us - point.sample.utime_us % history::trace_bucket_us;
  if (open_ && start != open_->start_utime_us()) {
    if (touched_) finished_.push_back(open_->bucket());
    open_.reset();
  }
  if (!open_) open_.emplace(start);
  const double weight_s = point.bridged ? point.interval_s : 0;
  open_->add({.covered_s = weight_s,
              .measured_power_w = history::single(point.measured_power_w),
              .modelled_power_w = history::single(point.modelled_power_w),
              .speed_m_s = history::single(point.speed_m_s),
              .state_of_charge = state_of_charge,
              .measured_j = accounts.measured_s > 0 ? accounts.measured_j : signals::unmeasured,
              .modelled_j = accounts.modelled_j,
              .x_m = point.sample.pose[0],
              .y_m = point.sample.pose[1]},
             weight_s);
  touched_ = true;
}

std::vector<history::TraceBucket> TraceBuilder::take() {
  std::vector<history::TraceBucket> out = std::exchange(finished_, {});
  if (open_ && std::exchange(touched_, false)) out.push_back(open_->bucket());
  return out;
}

}  // namespace joulecast::ingest
