#include "tests/study/trial/motion/judged.h"

#include <utility>

#include "dynamics/drive_model.h"
#include "gap/diagnose/recordings.h"
#include "gap/verdict/adopt.h"
#include "robot/robot_file.h"
#include "tests/study/trial/case_pool.h"

namespace joulecast::trial::motion {
namespace {

NamedEffect named(const gap::DiagnosedEffect& effect) {
  NamedEffect out;
  out.id = effect.id;
  out.probability = effect.probability;
  out.alternatives = effect.alternatives;
  if (!effect.parameters.empty()) {
    out.strength = effect.parameters.front().value;
    out.deviation = effect.parameters.front().deviation;
  }
  out.group = effect.group;
  return out;
}

Answer answer_of(const gap::Diagnosis& diagnosis) {
  Answer answer;
  answer.verdict = gap::name_of(diagnosis.verdict);
  answer.verdict_probability = diagnosis.verdict_probability;
  for (const gap::DiagnosedEffect& effect : diagnosis.effects) answer.effects.push_back(named(effect));
  answer.outside_channel = diagnosis.outside.channel;
  answer.outside_follows = diagnosis.outside.follows;
  answer.gap = diagnosis.power_absolute_relative;
  answer.noise_floor = diagnosis.noise_floor;
  if (diagnosis.baseline) {
    answer.referee_error = diagnosis.baseline->held_out;
    answer.explanation_error = diagnosis.baseline->explanation_held_out;
    answer.unchanged_error = diagnosis.baseline->unchanged_model_held_out;
  }
  return answer;
}

// The robot file with the adoptable effects. Effects that do not fit into a robot file are left out.
robot::RobotModel explained(const robot::RobotModel& robot, const gap::Diagnosis& diagnosis) {
  const auto adopted = diagnosis.verdict == gap::Verdict::not_this_robot
                           ? gap::with_corrections(robot, diagnosis.adoptable)
                           : gap::with_effects(robot, diagnosis.adoptable);
  return adopted.value_or(robot);
}

}  // namespace

Result<std::vector<telemetry::Recording>> recorded_missions(const std::filesystem::path& log) {
  const std::string path = log.string();
  auto set = telemetry::load_recordings({&path, 1});
  if (!set) return tl::unexpected(std::move(set.error()));
  for (telemetry::Recording& mission : set->missions) mission.robot_id = set->robot_id;
  return std::move(set->missions);
}

Result<Answer> judge(const std::filesystem::path& log, const std::filesystem::path& robot_file) {
  const double began_s = thread_cpu_s();
  const auto robot = robot::load_robot(robot_file);
  if (!robot) return tl::unexpected(robot.error());
  const std::string path = log.string();
  const auto recordings = telemetry::load_recordings({&path, 1});
  if (!recordings) return tl::unexpected(recordings.error());
  const auto diagnosis = gap::diagnose(*recordings, *robot);
  Answer answer;
  if (diagnosis) {
    answer = answer_of(*diagnosis);
  } else {
    answer.refused = describe(diagnosis.error());
  }
  answer.processor_s = thread_cpu_s() - began_s;
  answer.explained = diagnosis ? explained(*robot, *diagnosis) : *robot;
  return answer;
}

Result<std::vector<double>> modelled_power_w(const robot::RobotModel& robot,
                                             std::span<const Instant> instants) {
  const auto model = dynamics::drive_model(robot);
  if (!model) return tl::unexpected(model.error());
  const double radius_m = robot.kinematics.wheel_radius_m, half_track_m = robot.kinematics.half_track_m;
  std::vector<double> power_w;
  for (const Instant& at : instants) {
    dynamics::Instant motion;
    for (std::size_t s : {0u, 1u}) {
      const double turn = (s == 0 ? 1 : -1) * half_track_m * at.yaw_acceleration_rad_s2;
      motion.wheel_speed_rad_s[s] = at.rim_m_s[s] / radius_m;
      motion.wheel_acceleration_rad_s2[s] = (at.acceleration_m_s2 + turn) / radius_m;
    }
    power_w.push_back(model->metered_battery_power(model->flow(motion).battery_power_w, at.voltage_v));
  }
  return power_w;
}

}  // namespace joulecast::trial::motion
