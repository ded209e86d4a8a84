#include "server/api/live_robot.h"

#include <cmath>

namespace joulecast::api {

answers::LiveRobot live_robot(const ingest::RobotSnapshot* snapshot) {
  answers::LiveRobot now;
  if (snapshot == nullptr) return now;
  now.state_of_charge = snapshot->state_of_charge;
  now.state_of_charge_sd = snapshot->charge.estimate.sd;
  now.charging = snapshot->charge.phase;
  now.to_full = snapshot->charge.to_full;
  now.speed_m_s = snapshot->speed_m_s;
  const signals::Sample& sample = snapshot->sample;
  if (sample.utime_us == 0) return now;
  now.battery_voltage_v = sample.battery_voltage_v;
  now.battery_current_a = sample.battery_current_a;
  const auto& pose = sample.pose;
  if (std::isfinite(pose[0] + pose[1] + pose[2])) now.pose = planning::Pose{pose[0], pose[1], pose[2]};
  if (std::isfinite(sample.payload_kg)) now.payload_kg = sample.payload_kg;
  return now;
}

}  // namespace joulecast::api
