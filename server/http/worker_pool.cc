#include "server/http/worker_pool.h"

#include <algorithm>
#include <utility>

namespace joulecast::http {

WorkerPool::WorkerPool(unsigned threads, std::size_t capacity) : capacity_(capacity) {
  for (unsigned i = 0; i < std::max(threads, 1U); ++i)
    threads_.emplace_back([this](const std::stop_token& stop) { work(stop); });
}

bool WorkerPool::submit(std::function<void()> task, bool admitted) {
  {
    const std::lock_guard lock(mutex_);
    if (!admitted && queue_.size() >= capacity_) return false;
    queue_.push_back(std::move(task));
  }
  filled_.notify_one();
  return true;
}

void WorkerPool::work(const std::stop_token& stop) {
  for (;;) {
    std::unique_lock lock(mutex_);
    if (!filled_.wait(lock, stop, [this] { return !queue_.empty(); })) return;
    auto task = std::move(queue_.front());
    queue_.pop_front();
    lock.unlock();
    task();
  }
}

}  // namespace joulecast::http
