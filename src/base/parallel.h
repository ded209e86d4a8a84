#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace joulecast {

// Runs `work(k)` for every k in [0, count), in no order, on this thread and at most `threads` - 1 others,
// never more than the machine has. `work` must not throw.
template <class Work>
void parallel_for(std::size_t count, std::size_t threads, Work&& work) {
  const std::size_t most = std::min({count, threads, std::size_t{std::thread::hardware_concurrency()}});
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    for (std::size_t k = next++; k < count; k = next++) work(k);
  };
  std::vector<std::jthread> others;
  for (std::size_t k = 1; k < most; ++k) others.emplace_back(run);
  run();
}

}  // namespace joulecast
