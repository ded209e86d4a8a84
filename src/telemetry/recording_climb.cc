#include "telemetry/recording_climb.h"

namespace joulecast::telemetry {

dynamics::ClimbReading climb_reading(const dynamics::Parameters<double>& parameters,
                                     const signals::Sample& sample, double height_m, signals::Step step) {
  const auto body = dynamics::body_of_wheels(parameters, sample.wheel_velocity_rad_s, {});
  return {sample.utime_us, body.speed_m_s, sample.pitch_rad, height_m, step == signals::Step::bridged};
}

std::vector<double> climb_of(const Recording& recording, const dynamics::Parameters<double>& parameters) {
  signals::CovariateReader height(signals::find_series(recording.covariates, signals::height_covariate));
  std::vector<dynamics::ClimbReading> readings;
  readings.reserve(recording.samples.size());
  const std::vector<signals::Step> steps = signals::steps_of(recording.samples);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const signals::Sample& sample = recording.samples[k];
    readings.push_back(climb_reading(parameters, sample, height.at(sample.utime_us), steps[k]));
  }
  return dynamics::climb_along(readings);
}

}  // namespace joulecast::telemetry
