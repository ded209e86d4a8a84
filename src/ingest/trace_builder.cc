#include "ingest/trace_builder.h"

#include <cmath>
#include <utility>

namespace joulecast::ingest {

void TraceBuilder::Sum::add(double value, double weight_s) {
  if (!std::isfinite(value)) return;
  weighted += value * weight_s;
  weight += weight_s;
  // A first sample has no interval; fmin and fmax pass over NaN.
  min = std::fmin(min, value);
  max = std::fmax(max, value);
}

history::Band TraceBuilder::Sum::band() const {
  return {min, weight > 0 ? weighted / weight : min, max};
}

history::TraceBucket TraceBuilder::Open::bucket() const {
  history::TraceBucket b;
  b.start_utime_us = start_utime_us;
  b.covered_s = covered_s;
  b.measured_power_w = measured.band();
  b.modelled_power_w = modelled.band();
  b.speed_m_s = speed.band();
  b.state_of_charge = state_of_charge;
  b.measured_j = measured_j;
  b.modelled_j = modelled_j;
  b.x_m = x.band().mean;
  b.y_m = y.band().mean;
  return b;
}

void TraceBuilder::begin() {
  finished_.clear();
  any_ = touched_ = false;
}

void TraceBuilder::add(const energy::MeterPoint& point, const signals::Accounts& accounts,
                       double state_of_charge) {
  std::int64_t start = point.sample.utime_us - point.sample.utime_us % history::trace_bucket_us;
  if (any_ && start != open_.start_utime_us) {
    if (touched_) finished_.push_back(open_.bucket());
    any_ = false;
  }
  if (!any_) {
    open_ = {};
    open_.start_utime_us = start;
    any_ = true;
  }
  const double weight = point.bridged ? point.interval_s : 0;
  open_.covered_s += weight;
  open_.measured.add(point.measured_power_w, weight);
  open_.modelled.add(point.modelled_power_w, weight);
  open_.speed.add(point.speed_m_s, weight);
  open_.x.add(point.sample.pose[0], weight);
  open_.y.add(point.sample.pose[1], weight);
  open_.state_of_charge = state_of_charge;
  open_.measured_j = accounts.measured_s > 0 ? accounts.measured_j : signals::unmeasured;
  open_.modelled_j = accounts.modelled_j;
  touched_ = true;
}

std::vector<history::TraceBucket> TraceBuilder::take() {
  std::vector<history::TraceBucket> out = std::exchange(finished_, {});
  if (any_ && touched_) out.push_back(open_.bucket());
  touched_ = false;
  return out;
}

}  // namespace joulecast::ingest
