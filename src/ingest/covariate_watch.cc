#include "ingest/covariate_watch.h"

#include <algorithm>
#include <cmath>

#include "telemetry/validation.h"

namespace joulecast::ingest {
namespace {

using signals::CovariateChange;
using Verdict = telemetry::CovariateTracker::Verdict;

constexpr std::size_t most_heights = 1000;  // ahead of the samples: a second of them, and more

// Counts the present value up to that time.
void count(history::CovariateSummary& summary, std::int64_t until_utime_us) {
  if (until_utime_us <= summary.counted_utime_us) return;
  const double span_s = 1e-6 * static_cast<double>(until_utime_us - summary.counted_utime_us);
  summary.counted_utime_us = until_utime_us;
  if (std::isnan(summary.value)) return;
  if (summary.known_s == 0) summary.mean = summary.value;
  summary.known_s += span_s;
  summary.mean += (summary.value - summary.mean) * span_s / summary.known_s;
}

}  // namespace

void CovariateWatch::take(const signals::CovariateMessage& message, const Fault& fault) {
  for (const signals::Covariate& covariate : message.covariates) {
    if (const auto implausible = telemetry::check_plausible(covariate)) {
      fault(IngestFault::implausible,
            "covariate " + covariate.name + ": " + telemetry::describe(*implausible));
      continue;
    }
    CovariateChange change;
    const Verdict verdict = tracker_.take(message.utime_us, covariate, change);
    if (verdict == Verdict::late) fault(IngestFault::late, {});
    if (verdict == Verdict::no_room) fault(IngestFault::too_many_covariates, {});
    if (verdict != Verdict::news) continue;
    if (covariate.name == signals::height_covariate) hear_height(message.utime_us, covariate.value);
    if (in_mission_) note(std::move(change));
  }
}

void CovariateWatch::note(CovariateChange change) {
  auto summary = std::ranges::find(summaries_, change.name, &history::CovariateSummary::name);
  if (summary == summaries_.end()) {
    summaries_.emplace_back().name = change.name;
    summary = summaries_.end() - 1;
    summary->counted_utime_us = change.utime_us;
  }
  count(*summary, change.utime_us);
  summary->counted_utime_us = std::max(summary->counted_utime_us, change.utime_us);
  summary->value = change.value;
  summary->value_utime_us = change.utime_us;
  if (summary->known_s == 0) summary->mean = change.value;
  summary->min = std::fmin(summary->min, change.value);
  summary->max = std::fmax(summary->max, change.value);
  pending_.push_back(std::move(change));
}

void CovariateWatch::begin_mission(std::int64_t start_utime_us) {
  in_mission_ = true;
  summaries_.clear();
  pending_.clear();
  for (CovariateChange& change : tracker_.begin_mission(start_utime_us)) note(std::move(change));
}

void CovariateWatch::resume(const history::Mission& mission) {
  in_mission_ = true;
  summaries_ = mission.covariates;
  std::vector<CovariateChange> held;
  for (const history::CovariateSummary& summary : summaries_) {
    held.push_back({summary.value_utime_us, summary.name, summary.value});
    if (summary.name == signals::height_covariate) height_m_ = summary.value;
  }
  tracker_.resume(mission.start_utime_us, held);
}

std::vector<CovariateChange> CovariateWatch::settle(history::Mission& record) {
  for (history::CovariateSummary& summary : summaries_) count(summary, record.end_utime_us);
  record.covariates = summaries_;
  return std::exchange(pending_, {});
}

void CovariateWatch::on_clock_step(std::int64_t utime_us) {
  heights_.clear();
  for (history::CovariateSummary& summary : summaries_) summary.counted_utime_us = utime_us;
}

void CovariateWatch::hear_height(std::int64_t utime_us, double height_m) {
  if (heights_.size() == most_heights) heights_.pop_front();
  heights_.emplace_back(utime_us, height_m);
}

double CovariateWatch::climb_at(const dynamics::Parameters<double>& parameters, const signals::Sample& sample,
                                signals::Step step) {
  for (; !heights_.empty() && heights_.front().first <= sample.utime_us; heights_.pop_front())
    height_m_ = heights_.front().second;
  return climb_.add(reader_.at(parameters, sample, height_m_, step));
}

}  // namespace joulecast::ingest
