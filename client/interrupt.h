#pragma once

#include <boost/core/noncopyable.hpp>
#include <chrono>
#include <csignal>

namespace joulecast::client {

// During its lifetime ctrl-C and SIGTERM end waits instead of the program. The signals are blocked and
// polled, so that no code runs in a handler; threads started during that time inherit the block. Construct it
// before opening LCM.
class InterruptGuard : boost::noncopyable {
 public:
  InterruptGuard();
  ~InterruptGuard();

  // Waits until then or until interrupted; true from the first interrupt on.
  bool wait_until(std::chrono::steady_clock::time_point until);
  bool interrupted() { return wait_until({}); }

 private:
  sigset_t signals_;
  sigset_t before_;
  bool interrupted_ = false;
};

}  // namespace joulecast::client
