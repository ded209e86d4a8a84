#include "telemetry/recording_climb.h"

namespace joulecast::telemetry {

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
