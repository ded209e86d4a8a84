#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>

#include "planning/cost_table.h"

namespace joulecast::planning {

// Recently used cost tables, one for each different robot model and way of driving: robots that differ only
// in name and battery share one. Any thread; a table is built outside the lock, by each thread that finds it
// missing.
class CostTableCache {
 public:
  explicit CostTableCache(std::size_t capacity = 4096) : capacity_(capacity) {}

  Result<std::shared_ptr<const CostTable>> get(const robot::RobotModel& robot, const CostOptions& options,
                                               std::stop_token stop = {});
  std::size_t size() const;

 private:
  struct Entry {
    robot::RobotModel robot;  // without name and battery, but for the voltage
    CostOptions options;
    std::shared_ptr<const CostTable> table;
  };
  std::shared_ptr<const CostTable> find(const robot::RobotModel& robot, const CostOptions& options);

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // the latest used first
};

}  // namespace joulecast::planning
