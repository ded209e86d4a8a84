#include "client/trial/motion/judged.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "client/trial/case_pool.h"
#include "dynamics/drive_model.h"
#include "gap/adopt.h"
#include "gap/diagnosis.h"
#include "gap/diagnosis_json.h"
#include "gap/recordings.h"
#include "robot/robot_file.h"

namespace joulecast::trial::motion {
namespace {

using nlohmann::json;

// A template, so that a diagnosis that has no surrogates compiles too.
template <class Settings>
Result<void> ask_controls(Settings& settings, std::size_t controls) {
  if (controls == 0) return {};
  if constexpr (requires { settings.controls = controls; }) {
    settings.controls = controls;
    return {};
  } else {
    return invalid("--controls", "is given, and this diagnosis makes no surrogates");
  }
}

double number_or(const json& object, const char* name, double otherwise) {
  const auto found = object.find(name);
  return found != object.end() && found->is_number() ? found->get<double>() : otherwise;
}

std::string text_of(const json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

NamedEffect named(const json& effect, const std::vector<gap::DiagnosedParameter>& parameters) {
  NamedEffect out;
  out.id = effect.at("id").get<std::string>();
  out.probability = number_or(effect, "probability", 0);
  out.alternatives = effect.value("alternatives", std::vector<std::string>{});
  if (!parameters.empty()) {
    out.strength = parameters.front().value;
    out.deviation = parameters.front().deviation;
  }
  return out;
}

Answer answer_of(const gap::Diagnosis& diagnosis) {
  const json document = gap::diagnosis_to_json(diagnosis);
  Answer answer;
  answer.verdict = text_of(document, "verdict");
  answer.verdict_probability = number_or(document, "verdict_probability", 0);
  for (std::size_t k = 0; k < diagnosis.effects.size(); ++k) {
    answer.effects.push_back(named(document.at("effects").at(k), diagnosis.effects[k].parameters));
  }
  answer.outside_channel = text_of(document.at("outside"), "channel");
  answer.outside_follows = text_of(document.at("outside"), "follows");
  answer.gap = number_or(document.at("gap"), "power_absolute_relative", 0);
  answer.noise_floor = number_or(document.at("gap"), "noise_floor", 0);
  if (const auto referee = document.find("baseline"); referee != document.end() && referee->is_object()) {
    answer.referee_error = number_or(*referee, "held_out", 0);
    answer.explanation_error = number_or(document.at("shrinkage"), "held_out_after", 0);
  }
  return answer;
}

}  // namespace

Result<std::vector<telemetry::Recording>> recorded_missions(const std::filesystem::path& log) {
  const std::string path = log.string();
  auto set = gap::load_recordings({&path, 1});
  if (!set) return tl::unexpected(std::move(set.error()));
  for (telemetry::Recording& mission : set->missions) mission.robot_id = set->robot_id;
  return std::move(set->missions);
}

Result<Answer> judge(const std::filesystem::path& log, const std::filesystem::path& robot_file,
                     const JudgeSettings& asked) {
  gap::DiagnosisSettings settings;
  if (auto done = ask_controls(settings, asked.controls); !done)
    return tl::unexpected(std::move(done.error()));
  const double began_s = thread_cpu_s();
  const auto robot = robot::load_robot(robot_file);
  if (!robot) return tl::unexpected(robot.error());
  const std::string path = log.string();
  const auto recordings = gap::load_recordings({&path, 1});
  if (!recordings) return tl::unexpected(recordings.error());
  const auto diagnosis = gap::diagnose(*recordings, *robot, settings);
  Answer answer;
  if (diagnosis) {
    answer = answer_of(*diagnosis);
  } else {
    answer.refused = describe(diagnosis.error());
  }
  answer.processor_s = thread_cpu_s() - began_s;
  // What does not fit into a robot file explains nothing.
  answer.explained = diagnosis ? gap::with_effects(*robot, diagnosis->adoptable).value_or(*robot) : *robot;
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
