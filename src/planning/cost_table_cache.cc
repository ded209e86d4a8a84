#include "planning/cost_table_cache.h"

#include <bit>
#include <initializer_list>
#include <utility>

#include "base/try.h"

namespace joulecast::planning {
namespace {

// The parts of a robot that the table depends on: limits_of reads the battery's voltage.
robot::RobotModel drive_of(const robot::RobotModel& robot) {
  robot::RobotModel drive = robot;
  drive.robot_id.clear();
  drive.battery = {};
  drive.battery.nominal_voltage_v = robot.battery.nominal_voltage_v;
  return drive;
}

std::size_t hash_of(const robot::RobotModel& r, const CostOptions& options) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const double value :
       {r.kinematics.wheel_radius_m, r.mass.chassis_kg, r.mass.yaw_inertia_kg_m2, r.motor.resistance_ohm,
        r.motor.torque_constant_nm_a, r.motor.viscous_friction_nm_s_rad, r.motor.friction_torque_nm[0],
        r.motor.friction_torque_nm[1], r.idle_power_w, r.limits.payload_kg, options.value_of_time_w}) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x100000001b3u;
    hash ^= hash >> 29;
  }
  return static_cast<std::size_t>(hash);
}

}  // namespace

std::shared_ptr<const CostTable> CostTableCache::find(const robot::RobotModel& robot,
                                                      const CostOptions& options) {
  const std::size_t hash = hash_of(robot, options);
  for (auto at = entries_.begin(); at != entries_.end(); ++at) {
    if (at->first != hash || !(at->second.options == options) || !(at->second.robot == robot)) continue;
    entries_.splice(entries_.begin(), entries_, at);
    return entries_.front().second.table;
  }
  return nullptr;
}

Result<std::shared_ptr<const CostTable>> CostTableCache::get(const robot::RobotModel& robot,
                                                             const CostOptions& options,
                                                             std::stop_token stop) {
  robot::RobotModel drive = drive_of(robot);
  {
    const std::lock_guard lock(mutex_);
    if (auto table = find(drive, options)) return table;
  }
  TRY_ASSIGN(auto made, CostTable::make(drive, options, std::move(stop)));
  auto table = std::make_shared<const CostTable>(std::move(made));
  const std::lock_guard lock(mutex_);
  if (auto meanwhile = find(drive, options)) return meanwhile;
  entries_.emplace_front(hash_of(drive, options), Entry{std::move(drive), options, table});
  if (entries_.size() > capacity_) entries_.pop_back();
  return table;
}

std::size_t CostTableCache::size() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

}  // namespace joulecast::planning
