#include "tests/study/trial/ablations.h"

namespace joulecast::trial {

std::string_view name_of(Ablation ablation) {
  switch (ablation) {
    case Ablation::channels:
      return "without channels: battery power alone";
  }
  return "";
}

Result<gap::Diagnosis> diagnose_without(Ablation /*ablation*/, const telemetry::RecordingSet& recordings,
                                        const robot::RobotModel& robot) {
  telemetry::RecordingSet poorer = recordings;
  for (auto& mission : poorer.missions) {
    for (signals::Sample& sample : mission.samples) {
      sample.motor_voltage_v.fill(signals::unmeasured);
      sample.motor_current_a.fill(signals::unmeasured);
      sample.yaw_rate_rad_s = signals::unmeasured;
    }
  }
  return gap::diagnose(poorer, robot);
}

}  // namespace joulecast::trial
