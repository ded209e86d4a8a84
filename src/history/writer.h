#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/host_clock.h"
#include "history/store.h"

namespace joulecast::history {

struct WriterOptions {
  std::size_t queue_bytes = std::size_t{64} << 20;  // bound on the commands that wait, by weight_bytes()
  std::string spool_path;             // where stop() writes uncommitted commands; empty: they are lost
  std::size_t batch_commands = 1000;  // a transaction is committed at this many commands
  std::chrono::milliseconds batch_delay{200};       // or this long after its first command came
  std::chrono::milliseconds retry_first{50};        // pause after a failed commit, doubled each time
  std::chrono::milliseconds retry_last{5000};       // up to this
  Retention retention;                              // enforced every prune_interval
  std::optional<std::int64_t> missions_max_age_us;  // as PruneMissions; absent: missions are kept for ever
  std::optional<std::int64_t> events_kept;          // as PruneEvents; absent: events are kept for ever
  std::optional<std::int64_t> audit_max_age_us;     // as PruneAudit; absent: entries are kept for ever
  std::chrono::milliseconds prune_interval{60'000};
  std::function<bool()> prunes;  // whether this program enforces the retention now; empty: always
  // Retention by age goes by the wall clock, so it rests for this long after a step of that clock, and never
  // drops more than this share of the telemetry, the missions or the audit in an hour: against wrong clocks.
  std::chrono::milliseconds clock_distrust{3'600'000};
  double age_share_per_hour = 0.05;
  ClockSteps::Clock wall_clock = host_utime_us, steady_clock = host_boot_us;
  // Receives failed commits (the first, then once a minute), refused posted commands and recovery; called on
  // the writer's thread.
  std::function<void(const Error&)> on_error;
  std::function<void()> on_recovery = {};  // commits succeed again
  // Receives each mission that began under a name that its robot has used, with the key of the last mission
  // of that name; called on the writer's thread.
  std::function<void(const Mission&, MissionKey)> on_reused_name = {};
  // Receives each mission whose end was committed by a checkpoint of its own; called on the writer's thread.
  // After an exception the batch is committed again.
  std::function<void(const Mission&)> on_mission_ended = {};
  // Called with every accepted event, before it is committed, under the queue's lock: it must neither block
  // nor call the writer.
  std::function<void(const Event&)> on_event;
};

struct WriterStatus {
  bool healthy = true;  // the last commit attempt succeeded
  std::string error;    // why not
  std::size_t queue_commands = 0;
  std::size_t queue_bytes = 0;
  std::size_t queue_limit_bytes = 0;
  std::uint64_t posted = 0;        // commands accepted
  std::uint64_t merged = 0;        // of them those that a waiting command took up
  std::uint64_t shed_samples = 0;  // raw samples left out because the queue was full
  std::uint64_t applied = 0;       // commands committed
  std::uint64_t refused = 0;       // commands that the store refused (bad content, not trouble with the disk)
  std::uint64_t commits = 0;       // transactions committed
  std::uint64_t failed_commits = 0;  // attempts that failed and were tried again
  std::uint64_t pruned_chunks = 0, pruned_missions = 0, pruned_events = 0, pruned_audit = 0;
  double total_commit_s = 0;  // over all `commits`
  double oldest_wait_s = 0;   // age of the oldest command not yet committed
  double attempt_s = 0;       // how long the commit that runs now has been running; 0: none runs
  std::uint64_t ticks = 0;    // turns of the writer's loop, at least one a second: for the watchdog
};

// The store's one writing thread: takes commands from any thread, commits them in batches, in order. A failed
// commit (disk full, locked, I/O) is tried again with the same commands until it succeeds. Commands not
// committed when stop()'s grace has passed go to the spool.
class Writer {
 public:
  Writer(Store& store, WriterOptions options);
  ~Writer();  // as stop(retry_last)

  // Queues a command; waits while the queue is full. Fault::unavailable after stop().
  Result<void> post(Command command);
  // Queues a command and never waits, for callers that must continue when the store stalls: a checkpoint is
  // merged into a waiting one of the same mission, and a training state replaces a waiting one of the same
  // topic. When the queue is full, checkpoints leave out their samples, covariates and trace (shed_samples);
  // the mission's account is kept. Fault::unavailable after stop().
  Result<void> offer(Command command);
  // Queues a command and waits for its commit. Fault::unavailable means that it was not done and will not be:
  // immediately while the store takes no data; when an attempt to commit it fails; when the timeout passes
  // before an attempt began. A running attempt is waited for until it ends, however long that takes. The
  // outcome is unknown, and the message indicates it, only if stop() cuts the attempt off, or if the
  // connection to the store broke during the commit and the outcome is still unknown at the stop.
  Outcome execute(Command command, std::chrono::milliseconds timeout = std::chrono::milliseconds{10'000});
  // The same of a change.
  Outcome execute(Change change);
  // Waits until everything posted before the call is committed.
  Result<void> flush(std::chrono::milliseconds timeout = std::chrono::milliseconds{30'000});
  // Accepts no more commands, commits the waiting ones for at most `grace`, and spools the rest; returns
  // within some seconds after that even when a commit hangs. unavailable when commands were spooled or lost.
  // To be called by one thread only.
  Result<void> stop(std::chrono::milliseconds grace);

  WriterStatus status() const;

 private:
  using Clock = std::chrono::steady_clock;

  // A caller that waits for a command's outcome.
  struct Waiter {
    bool queued = true;  // the command may still be withdrawn
    std::optional<Outcome> outcome;
    std::condition_variable done;
  };

  struct Item {
    std::uint64_t id = 0;  // increasing in the queue's order
    Command command;
    std::size_t bytes = 0;
    Clock::time_point since;
    std::shared_ptr<Waiter> waiter;  // null when no caller waits
  };
  using Place = std::list<Item>::iterator;

  // The batch being committed: the commands of the items, contiguous as apply() requires.
  struct Batch {
    std::list<Item> items;
    std::vector<Command> commands;
  };

  bool has_room(std::size_t bytes) const;
  std::optional<std::string> trouble() const;
  std::uint64_t oldest_id() const;
  void report_event(const Command& command) const;
  Place push(Command command, std::shared_ptr<Waiter> waiter);
  void shed(Command& command);
  bool merged(Command& command);
  void forget(const Item& item);
  void loop();
  bool take_batch();
  bool commit();
  void withdraw_awaited(const Error& why);
  bool wait_before_retry(const Error& error, std::chrono::milliseconds pause);
  bool settle(std::vector<Outcome>& outcomes, bool idle, double duration_s);
  void prune_when_due();
  void prune_by_age(double hours);
  std::int64_t prune(const Command& command);
  void end();
  static void refuse(Waiter& waiter, Error why);
  void tell(const Error& error) const {
    if (options_.on_error) options_.on_error(error);
  }

  Store& store_;
  const WriterOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable work_;       // for the writing thread
  std::condition_variable room_;       // for callers that wait to post
  std::condition_variable committed_;  // for callers of flush() and stop()
  std::list<Item> queue_;
  Batch batch_;                              // changed by the writing thread alone, with the mutex held
  std::map<MissionKey, Place> checkpoints_;  // the last one that waits, of a mission
  std::map<std::pair<std::string, std::string>, Place> learned_;  // the one that waits, of a robot and topic
  std::size_t queued_bytes_ = 0;                                  // waiting and in the batch
  std::uint64_t last_id_ = 0;
  std::size_t left_ = 0;                            // commands that the end left uncommitted
  std::optional<Clock::time_point> attempt_since_;  // a commit runs
  std::string why_;                                 // the last commit failed; empty: it did not
  Clock::time_point failing_since_, told_;
  bool commit_now_ = false;  // a caller waits: commit immediately
  bool stopping_ = false;
  bool ended_ = false;
  Clock::time_point stop_deadline_;
  WriterStatus status_;

  // The writing thread's own.
  Clock::time_point last_prune_, distrust_until_;
  double age_allowance_ = 0, mission_allowance_ = 0, audit_allowance_ = 0;  // that may be dropped by age
  ClockSteps steps_;

  std::thread thread_;
};

}  // namespace joulecast::history
