#include "client/interrupt.h"

#include <pthread.h>

#include <algorithm>

namespace joulecast::client {

InterruptGuard::InterruptGuard() {
  sigemptyset(&signals_);
  sigaddset(&signals_, SIGINT);
  sigaddset(&signals_, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals_, &before_);
}

InterruptGuard::~InterruptGuard() {
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

bool InterruptGuard::wait_until(std::chrono::steady_clock::time_point until) {
  using std::chrono::nanoseconds;
  while (!interrupted_) {
    const auto left = std::max(nanoseconds(0), nanoseconds(until - std::chrono::steady_clock::now()));
    const timespec wait{static_cast<time_t>(left.count() / 1'000'000'000),
                        static_cast<long>(left.count() % 1'000'000'000)};
    interrupted_ = sigtimedwait(&signals_, nullptr, &wait) > 0;
    if (left.count() == 0) break;
  }
  return interrupted_;
}

}  // namespace joulecast::client
