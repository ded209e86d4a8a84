#include "planning/cost_table_cache.h"

#include <algorithm>
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

}  // namespace

std::shared_ptr<const CostTable> CostTableCache::find(const robot::RobotModel& robot,
                                                      const CostOptions& options) {
  const auto found = std::ranges::find_if(
      entries_, [&](const Entry& each) { return each.options == options && each.robot == robot; });
  if (found == entries_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found);
  return found->table;
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
  entries_.push_front({std::move(drive), options, table});
  if (entries_.size() > capacity_) entries_.pop_back();
  return table;
}

std::size_t CostTableCache::size() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

}  // namespace joulecast::planning
