#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/error.h"
#include "history/store.h"

namespace joulecast::history {

struct WriterOptions {
  std::size_t queue_bytes = std::size_t{64} << 20;  // bound on the commands that wait, by weight_bytes()
  std::size_t batch_commands = 1000;                // a transaction is committed at this many commands
  std::chrono::milliseconds batch_delay{200};       // or this long after its first command came
  std::chrono::milliseconds retry_first{50};        // pause after a failed commit, doubled each time
  std::chrono::milliseconds retry_last{5000};       // up to this
  Retention retention;                              // enforced every prune_interval
  std::chrono::milliseconds prune_interval{60'000};
  // Told of failed commits (once a failure), refused posted commands and recovery; called on the writer's
  // thread.
  std::function<void(const Error&)> on_error;
};

struct WriterStatus {
  bool healthy = true;  // the last commit attempt succeeded
  std::string error;    // why not
  std::size_t queue_commands = 0;
  std::size_t queue_bytes = 0;
  std::uint64_t posted = 0;      // commands accepted into the queue
  std::uint64_t overflowed = 0;  // commands that try_post turned away
  std::uint64_t applied = 0;     // commands committed
  std::uint64_t refused = 0;     // commands that the store refused (bad content, not trouble with the disk)
  std::uint64_t commits = 0;     // transactions committed
  std::uint64_t failed_commits = 0;  // attempts that failed and were tried again
  std::uint64_t pruned_chunks = 0;
  double last_commit_s = 0;  // duration of the last successful apply()
  double max_commit_s = 0;
  double total_commit_s = 0;  // over all `commits`
  double oldest_wait_s = 0;   // age of the oldest command not yet committed
  std::uint64_t ticks = 0;    // turns of the writer's loop, at least one a second: for the watchdog
};

// The store's one writing thread: takes commands from any thread, commits them in batches, in order. A failed
// commit (disk full, locked, I/O) is tried again with the same commands until it succeeds; nothing taken is
// dropped, except what is left when the destructor's grace has passed, which on_error is told with its count.
class Writer {
 public:
  Writer(Store& store, WriterOptions options);
  ~Writer();  // flushes for at most retry_last, then stops

  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  // Queues a command; waits while the queue is full. Fault::unavailable after stop().
  Result<void> post(Command command);
  // Queues a command unless the queue is full (Fault::unavailable, counted); the caller keeps it by retrying
  // later.
  Result<void> try_post(Command& command);
  // Queues a command and waits for its commit. On Fault::unavailable by timeout the command still stands in
  // the queue.
  Outcome execute(Command command, std::chrono::milliseconds timeout = std::chrono::milliseconds{10'000});
  // Waits until everything posted before the call is committed.
  Result<void> flush(std::chrono::milliseconds timeout = std::chrono::milliseconds{30'000});
  // Accepts no more, commits what waits for at most `grace`. unavailable when commands were left. To be
  // called by one thread only.
  Result<void> stop(std::chrono::milliseconds grace);

  WriterStatus status() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::history
