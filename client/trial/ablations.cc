#include "client/trial/ablations.h"

namespace joulecast::trial {

std::string_view name_of(Ablation ablation) {
  switch (ablation) {
    case Ablation::channels:
      return "without channels: battery power alone";
    case Ablation::weak_form:
      return "without weak form: three samples at a time";
    case Ablation::whitening:
      return "without whitening";
    case Ablation::scatter:
      return "without scatter between missions";
    case Ablation::tolerances:
      return "without calibration tolerances";
    case Ablation::open_set:
      return "without open set";
  }
  return "";
}

Result<gap::Diagnosis> diagnose_without(Ablation ablation, const telemetry::RecordingSet& recordings,
                                        const robot::RobotModel& robot) {
  gap::DiagnosisSettings settings;
  gap::MethodParts& parts = settings.parts;
  switch (ablation) {
    case Ablation::channels: {
      telemetry::RecordingSet poorer = recordings;
      for (auto& mission : poorer.missions) {
        for (telemetry::Sample& sample : mission.samples) {
          sample.motor_voltage_v.fill(telemetry::unmeasured);
          sample.motor_current_a.fill(telemetry::unmeasured);
          sample.yaw_rate_rad_s = telemetry::unmeasured;
        }
      }
      return gap::diagnose(poorer, robot, settings);
    }
    case Ablation::weak_form:
      parts.windows.length_s = 0.06;
      parts.windows.fewest_samples = 3;
      break;
    case Ablation::whitening:
      parts.whitening = false;
      break;
    case Ablation::scatter:
      parts.scatter = false;
      break;
    case Ablation::tolerances:
      parts.tolerances = false;
      break;
    case Ablation::open_set:
      parts.open_set = false;
      break;
  }
  return gap::diagnose(recordings, robot, settings);
}

}  // namespace joulecast::trial
