#include "telemetry/recording.h"

#include <algorithm>
#include <span>

#include "base/try.h"
#include "telemetry/codec.h"

namespace joulecast::telemetry {
namespace {

Result<void> write_event(EventLogWriter& log, const Recording& recording, signals::MissionPhase phase,
                         std::int64_t utime_us) {
  const signals::MissionEvent event{utime_us, recording.mission_id, phase, recording.payload_kg, {}};
  return encode_mission_event(recording.robot_id, event)
      .and_then([&](const std::vector<std::uint8_t>& bytes) {
        return log.write(utime_us, channel_of(Subject::mission_event, recording.robot_id), bytes);
      });
}

// Changes in order of time: one message an instant, or several where it changes more than one holds.
Result<void> write_changes(EventLogWriter& log, const std::string& robot_id,
                           std::span<const signals::CovariateChange> changes) {
  const std::string channel = channel_of(Subject::covariates, robot_id);
  for (std::size_t k = 0; k < changes.size();) {
    signals::CovariateMessage message{changes[k].utime_us, {}};
    for (; k < changes.size() && changes[k].utime_us == message.utime_us &&
           message.covariates.size() < signals::max_covariates;
         ++k)
      message.covariates.push_back({changes[k].name, changes[k].value});
    TRY_ASSIGN(const std::vector<std::uint8_t> bytes, encode_covariates(robot_id, message));
    TRY(log.write(message.utime_us, channel, bytes));
  }
  return {};
}

}  // namespace

std::size_t put_in_order(std::vector<signals::Sample>& samples) {
  std::ranges::stable_sort(samples, {}, &signals::Sample::utime_us);
  const auto same = std::ranges::unique(samples, {}, &signals::Sample::utime_us);
  const std::size_t dropped = same.size();
  samples.erase(same.begin(), same.end());
  return dropped;
}

Result<void> write_recording(EventLogWriter& log, const Recording& recording) {
  if (recording.samples.empty()) return invalid("samples", "a recording needs one sample at least");
  const std::string channel = channel_of(Subject::telemetry, recording.robot_id);
  const std::vector<signals::CovariateChange> changes = signals::changes_of(recording.covariates);
  std::span<const signals::CovariateChange> left = changes;
  TRY(write_event(log, recording, signals::MissionPhase::started, recording.samples.front().utime_us));
  for (const signals::Sample& sample : recording.samples) {
    std::size_t count = 0;
    while (count < left.size() && left[count].utime_us <= sample.utime_us) ++count;
    TRY(write_changes(log, recording.robot_id, left.first(count)));
    left = left.subspan(count);
    TRY_ASSIGN(const auto bytes, encode_telemetry(recording.robot_id, sample));
    TRY(log.write(sample.utime_us, channel, bytes));
  }
  const std::int64_t end_us = recording.samples.back().utime_us;
  TRY(write_event(log, recording, signals::MissionPhase::finished, end_us));
  std::vector<signals::CovariateChange> unknown;
  for (const signals::CovariateSeries& series : recording.covariates) {
    if (!series.value.empty() && !std::isnan(series.value.back()))
      unknown.push_back({std::max(end_us, series.utime_us.back()) + 1, series.name, signals::unmeasured});
  }
  return write_changes(log, recording.robot_id, unknown);
}

dynamics::ClimbReading ClimbReader::at(const dynamics::Parameters<double>& parameters,
                                       const signals::Sample& sample, double height_m, signals::Step step) {
  if (step != signals::Step::bridged) pitch_ = {};
  const auto body = dynamics::body_of_wheels(parameters, sample.wheel_velocity_rad_s, {});
  return {sample.utime_us, body.speed_m_s, pitch_.take(sample.utime_us, sample.pitch_rad), height_m,
          step == signals::Step::bridged};
}

std::vector<double> climb_of(const Recording& recording, const dynamics::Parameters<double>& parameters) {
  signals::CovariateReader height(signals::find_series(recording.covariates, signals::height_covariate));
  ClimbReader reader;
  std::vector<dynamics::ClimbReading> readings;
  readings.reserve(recording.samples.size());
  const std::vector<signals::Step> steps = signals::steps_of(recording.samples);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const signals::Sample& sample = recording.samples[k];
    readings.push_back(reader.at(parameters, sample, height.at(sample.utime_us), steps[k]));
  }
  return dynamics::climb_along(readings);
}

}  // namespace joulecast::telemetry
