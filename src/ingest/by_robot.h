#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace joulecast::ingest {

// The latest immutable value of every robot. Any thread; the lock is held only to copy pointers.
template <class Value>
class ByRobot {
 public:
  using Pointer = std::shared_ptr<const Value>;

  void put(const std::string& robot_id, Pointer value) {
    const std::lock_guard lock(mutex_);
    std::swap(latest_[robot_id], value);  // the one before is freed after the lock is
  }
  void remove(std::string_view robot_id) {
    const std::lock_guard lock(mutex_);
    if (const auto found = latest_.find(robot_id); found != latest_.end()) latest_.erase(found);
  }
  // Null: there is none.
  Pointer find(std::string_view robot_id) const {
    const std::shared_lock lock(mutex_);
    const auto found = latest_.find(robot_id);
    return found == latest_.end() ? nullptr : found->second;
  }
  // By robot id.
  std::vector<Pointer> all() const {
    const std::shared_lock lock(mutex_);
    std::vector<Pointer> values;
    values.reserve(latest_.size());
    for (const auto& [id, value] : latest_) values.push_back(value);
    return values;
  }
  std::size_t size() const {
    const std::shared_lock lock(mutex_);
    return latest_.size();
  }

 private:
  mutable std::shared_mutex mutex_;
  std::map<std::string, Pointer, std::less<>> latest_;
};

}  // namespace joulecast::ingest
