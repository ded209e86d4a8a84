#include "ingest/sample_order.h"

#include <algorithm>

namespace joulecast::ingest {

bool SampleOrder::take(const signals::Sample& sample, std::int64_t host_utime_us) {
  release(host_utime_us);
  const std::int64_t step = sample.sequence - next_;  // neither is negative
  if (next_ < 0 || step == 0 || window_us_ == 0) {
    pass(sample);
    if (!waiting_.empty() && waiting_.begin()->first == next_) pass_run();
    return true;
  }
  if (step < 0) {
    const std::int64_t newest_us =
        waiting_.empty() ? newest_utime_us_ : waiting_.rbegin()->second.sample.utime_us;
    const bool restart =
        sample.utime_us > newest_us || sample.utime_us < newest_utime_us_ - backward_jump_us_;
    if (restart) {
      flush();
      pass(sample);
    } else {
      sink_(sample);
    }
    return true;
  }
  if (step > longest_hole) {
    flush();
    pass(sample);
    return true;
  }
  if (waiting_.empty()) since_us_ = host_utime_us;
  const auto [place, fresh] = waiting_.try_emplace(sample.sequence, Waiting{sample, host_utime_us});
  if (!fresh && place->second.sample.utime_us == sample.utime_us) return false;
  if (!fresh) {
    flush();
    sink_(sample);
  }
  if (waiting_.size() > capacity) pass_run();
  return true;
}

void SampleOrder::release(std::int64_t host_utime_us) {
  since_us_ = std::min(since_us_, host_utime_us);  // the host's clock was set back
  while (!waiting_.empty() && host_utime_us - since_us_ >= window_us_) pass_run();
}

void SampleOrder::pass(const signals::Sample& sample) {
  next_ = sample.sequence + 1;
  newest_utime_us_ = sample.utime_us;
  sink_(sample);
}

void SampleOrder::pass_run() {
  next_ = waiting_.begin()->first;
  while (!waiting_.empty() && waiting_.begin()->first == next_) {
    const signals::Sample sample = waiting_.begin()->second.sample;
    waiting_.erase(waiting_.begin());
    pass(sample);
  }
  if (waiting_.empty()) return;
  since_us_ = std::ranges::min_element(waiting_, {}, [](const auto& each) {
                return each.second.host_utime_us;
              })->second.host_utime_us;
}

}  // namespace joulecast::ingest
