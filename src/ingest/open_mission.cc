#include "ingest/open_mission.h"

#include <algorithm>
#include <utility>

namespace joulecast::ingest {
namespace {

history::MissionState state_of(telemetry::MissionEnd end) {
  switch (end) {
    case telemetry::MissionEnd::finished:
    case telemetry::MissionEnd::idle:
    case telemetry::MissionEnd::expired:
      return history::MissionState::finished;
    case telemetry::MissionEnd::aborted:
      return history::MissionState::aborted;
    case telemetry::MissionEnd::superseded:
      return history::MissionState::superseded;
    case telemetry::MissionEnd::unfinished:
      return history::MissionState::unfinished;
  }
  return history::MissionState::unfinished;
}

constexpr const char* service_was_down = "the service was down during the mission";

// Whether any of its stored samples contained a payload that applies to the mission.
bool payload_was_said(const history::Mission& stored) {
  const auto zeros = stored.sample_faults.find(name_of(IngestFault::zero_payload));
  return stored.samples > (zeros == stored.sample_faults.end() ? 0 : zeros->second);
}

}  // namespace

OpenMission::OpenMission(const std::string& robot_id, const telemetry::MissionAction& action,
                         std::int64_t model_version, std::string memory)
    : payload(action.payload_kg), charge_memory(std::move(memory)) {
  record.robot_id = robot_id;
  record.mission_id = action.mission_id;
  record.start_utime_us = record.end_utime_us = action.utime_us;
  record.implicit = action.implicit;
  record.payload_kg = action.payload_kg;
  record.note = action.note;
  record.model_version = model_version;
}

OpenMission::OpenMission(const history::Mission& from)
    : record(from),
      stored(true),
      payload(from.payload_kg, payload_was_said(from)),
      was_down(true),
      resumed_silent(true),
      unmetered(true),
      earlier_gaps_(from.gap_count),
      earlier_gap_s_(from.gap_s) {}

void OpenMission::end_at(std::int64_t utime_us) {
  record.end_utime_us = std::max(record.start_utime_us, utime_us);
}

void OpenMission::keep(const signals::Sample& sample) {
  ++record.samples;
  ++unsaved;
  samples.push_back(sample);
}

void OpenMission::mark_incomplete(const char* reason) {
  record.incomplete = true;
  record.incomplete_reason = reason;
}

void OpenMission::use_another_meter(std::int64_t model_version) {
  earlier_gaps_ = record.gap_count;
  earlier_gap_s_ = record.gap_s;
  record.model_version = model_version;
}

void OpenMission::go_on_after_silence(std::int64_t utime_us) {
  resumed_silent = unmetered = false;
  const double down_s = static_cast<double>(utime_us - record.end_utime_us) * 1e-6;
  if (down_s <= signals::always_bridged_s) return;
  ++earlier_gaps_;
  earlier_gap_s_ += down_s;
  mark_incomplete(service_was_down);
}

void OpenMission::refresh(const energy::Meter& meter) {
  record.accounts = meter.accounts();
  record.gap_count = earlier_gaps_ + static_cast<std::int64_t>(meter.gaps());
  record.gap_s = earlier_gap_s_ + meter.gap_seconds();
  if (meter.gaps() > 0 && !record.incomplete)
    mark_incomplete(was_down ? service_was_down : "no samples for longer than can be bridged");
}

void OpenMission::finish(const telemetry::MissionAction& action) {
  record.state = resumed_silent ? history::MissionState::interrupted : state_of(action.end);
  if (record.state == history::MissionState::unfinished ||
      record.state == history::MissionState::interrupted) {
    record.incomplete = true;
    if (record.incomplete_reason.empty())
      mark_incomplete(resumed_silent
                          ? "the service stopped during the mission and the robot did not come back"
                          : "the robot fell silent before the end");
  }
  // Robots often send the same note at a mission's start and its end.
  if (!action.note.empty() && action.note != record.note)
    record.note += (record.note.empty() ? "" : "; ") + action.note;
  record.end_utime_us = std::max(record.end_utime_us, action.utime_us);
}

void OpenMission::on_clock_step(std::int64_t host_utime_us) {
  if (record.samples == 0) return;
  mark_incomplete("the robot's clock was set during the mission");
  if (!stepped_utime_us_) stepped_utime_us_ = host_utime_us;
}

std::optional<OpenMission::TooFast> OpenMission::book(std::int64_t elapsed_us, std::int64_t host_utime_us,
                                                      std::int64_t margin_us) {
  if (!stepped_utime_us_) return {};
  const std::int64_t passed_us = host_utime_us - *stepped_utime_us_;
  if (booked_us_ + elapsed_us > passed_us + margin_us) return TooFast{booked_us_ + elapsed_us, passed_us};
  booked_us_ += elapsed_us;
  return {};
}

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
