#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <mutex>
#include <stop_token>
#include <utility>

namespace joulecast {

// The host's clock, microseconds since the Unix epoch. Robots have clocks of their own.
inline std::int64_t host_utime_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Microseconds since the host was booted, its sleep included. It is never set.
inline std::int64_t host_boot_us() {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return std::int64_t{1'000'000} * now.tv_sec + now.tv_nsec / 1000;
}

// Sleeps for the time; false, immediately, if the thread is to stop.
inline bool sleep_for(const std::stop_token& stop, std::chrono::steady_clock::duration time) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);  // cppcheck-suppress localMutex
  wake.wait_for(lock, stop, time, [] { return false; });
  return !stop.stop_requested();
}

// Finds the steps of the host's clock: differences between its advance and the elapsed time.
class ClockSteps {
 public:
  using Clock = std::function<std::int64_t()>;

  explicit ClockSteps(Clock wall_us = host_utime_us, Clock steady_us = host_boot_us)
      : wall_us_(std::move(wall_us)), steady_us_(std::move(steady_us)), offset_us_(offset_us()) {}

  // Returns the step of the clock since the last call, positive forward; 0 where slewing explains it.
  std::int64_t take_step_us() {
    const std::int64_t before_us = std::exchange(offset_us_, offset_us());
    const std::int64_t step_us = offset_us_ - before_us;
    return std::abs(step_us) < least_step_us ? 0 : step_us;
  }

 private:
  static constexpr std::int64_t least_step_us = 500'000;

  // Both clocks read at one moment: again if the thread was kept waiting in between.
  std::int64_t offset_us() const {
    for (;;) {
      const std::int64_t before_us = steady_us_(), wall_us = wall_us_();
      if (steady_us_() - before_us < least_step_us / 10) return wall_us - before_us;
    }
  }

  Clock wall_us_, steady_us_;
  std::int64_t offset_us_;
};

}  // namespace joulecast
