#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace joulecast::http {

// A few threads and a bounded queue. Tasks must not throw.
class WorkerPool {
 public:
  WorkerPool(unsigned threads, std::size_t capacity);
  ~WorkerPool() = default;  // runs queued tasks, then joins
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // False when the queue is full; `admitted`, for the next piece of work that has begun, is never refused.
  // Any thread.
  bool submit(std::function<void()> task, bool admitted = false);

 private:
  void work(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any filled_;
  std::deque<std::function<void()>> queue_;
  std::size_t capacity_;
  std::vector<std::jthread> threads_;
};

}  // namespace joulecast::http
