#include "history/writer.h"

#include <algorithm>
#include <iterator>

#include "base/fault_boundary.h"
#include "base/units.h"
#include "history/spool.h"

namespace joulecast::history {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr std::chrono::milliseconds longest_sleep{1000};
constexpr std::chrono::seconds slow_commit{5};  // longer, and the store counts as stalled
constexpr std::chrono::seconds patience{4};     // with a commit that runs when stop()'s grace is over
constexpr std::chrono::seconds tell_again{60};  // of a store that still takes no data
constexpr std::int64_t events_at_once = 5000;   // that the retention drops in one transaction

Error unavailable(std::string message) {
  return Error{Fault::unavailable, "store", std::move(message)};
}
Error stopping() {
  return unavailable("the writer is stopping; not done");
}
Error cut_off() {
  return unavailable(
      "the writer stopped while this was being committed; the store shows whether it was done");
}

// Merges `later`, of the same mission, into `earlier`: one checkpoint with the effect of both.
void take_up(CheckpointMission& earlier, CheckpointMission later) {
  const auto append = [](auto& to, auto& from) {
    to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
  };
  earlier.mission = std::move(later.mission);
  append(earlier.trace, later.trace);
  append(earlier.samples, later.samples);
  append(earlier.covariates, later.covariates);
  if (later.resume_state) earlier.resume_state = std::move(later.resume_state);
  if (later.position) earlier.position = later.position;
}

}  // namespace

Writer::Writer(Store& store, WriterOptions options)
    : store_(store), options_(std::move(options)), steps_(options_.wall_clock, options_.steady_clock) {
  last_prune_ = Clock::now();
  thread_ = std::thread([this] { loop(); });
}

Writer::~Writer() {
  // A caller that needs the result of the last commits has called stop().
  if (!stopping_) (void)stop(options_.retry_last);
  if (thread_.joinable()) thread_.join();
}

Result<void> Writer::post(Command command) {
  const std::size_t bytes = weight_bytes(command);
  std::unique_lock lock(mutex_);
  room_.wait(lock, [&] { return stopping_ || has_room(bytes); });
  if (stopping_) return tl::unexpected(stopping());
  push(std::move(command), nullptr);
  return {};
}

Result<void> Writer::offer(Command command) {
  const std::lock_guard lock(mutex_);
  if (stopping_) return tl::unexpected(stopping());
  if (!has_room(weight_bytes(command))) shed(command);
  if (merged(command)) return {};
  push(std::move(command), nullptr);
  return {};
}

Outcome Writer::execute(Command command, std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  const std::size_t bytes = weight_bytes(command);
  std::unique_lock lock(mutex_);
  room_.wait_until(lock, deadline, [&] { return stopping_ || trouble() || has_room(bytes); });
  if (stopping_) return tl::unexpected(stopping());
  if (const auto why = trouble())
    return tl::unexpected(unavailable("takes no data for now, so this was not done: " + *why));
  if (!has_room(bytes)) return tl::unexpected(unavailable("the writer's queue is full; not done"));
  const auto waiter = std::make_shared<Waiter>();
  const auto item = push(std::move(command), waiter);
  commit_now_ = true;
  work_.notify_one();
  const auto answered = [&] { return waiter->outcome.has_value(); };
  if (!waiter->done.wait_until(lock, deadline, answered) && waiter->queued) {
    queued_bytes_ -= item->bytes;
    queue_.erase(item);
    return tl::unexpected(unavailable("not committed in time and withdrawn; not done"));
  }
  // It is being committed: the outcome is decided at the commit's end.
  waiter->done.wait(lock, answered);
  return std::move(*waiter->outcome);
}

Outcome Writer::execute(Change change) {
  return execute(Command(CommitChange{std::make_shared<Change>(std::move(change))}));
}

Result<void> Writer::flush(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  const std::uint64_t target = last_id_;
  const auto committed = [&] { return oldest_id() > target; };
  commit_now_ = true;
  work_.notify_one();
  committed_.wait_for(lock, timeout, [&] { return committed() || ended_; });
  if (committed() && left_ == 0) return {};
  return tl::unexpected(
      unavailable("posted commands are not committed yet" + (why_.empty() ? std::string() : ": " + why_)));
}

Result<void> Writer::stop(std::chrono::milliseconds grace) {
  std::unique_lock lock(mutex_);
  if (!stopping_) stop_deadline_ = Clock::now() + grace;
  stopping_ = true;
  work_.notify_all();
  room_.notify_all();
  // An attempt that runs when the grace is over may still succeed: it is waited for, but not for ever.
  committed_.wait_until(lock, stop_deadline_ + patience, [&] { return ended_; });
  if (!ended_) end();
  if (left_ == 0) return {};
  return tl::unexpected(unavailable(std::to_string(left_) + " commands were not committed: " + why_));
}

WriterStatus Writer::status() const {
  const std::lock_guard lock(mutex_);
  WriterStatus now = status_;
  const auto why = trouble();
  now.healthy = !why;
  now.error = why.value_or("");
  now.queue_commands = queue_.size() + batch_.items.size();
  now.queue_bytes = queued_bytes_;
  now.queue_limit_bytes = options_.queue_bytes;
  if (!batch_.items.empty() || !queue_.empty()) {
    const Item& oldest = batch_.items.empty() ? queue_.front() : batch_.items.front();
    now.oldest_wait_s = Seconds(Clock::now() - oldest.since).count();
  }
  if (attempt_since_) now.attempt_s = Seconds(Clock::now() - *attempt_since_).count();
  return now;
}

// A command heavier than the whole bound passes when it is alone.
bool Writer::has_room(std::size_t bytes) const {
  return queued_bytes_ == 0 || queued_bytes_ + bytes <= options_.queue_bytes;
}

// Why the store takes no data.
std::optional<std::string> Writer::trouble() const {
  if (!why_.empty()) return why_;
  if (attempt_since_ && Clock::now() - *attempt_since_ > slow_commit)
    return "a commit has been running for " +
           std::to_string(static_cast<int>(Seconds(Clock::now() - *attempt_since_).count())) + " s";
  return std::nullopt;
}

std::uint64_t Writer::oldest_id() const {
  if (!batch_.items.empty()) return batch_.items.front().id;
  return queue_.empty() ? last_id_ + 1 : queue_.front().id;
}

void Writer::report_event(const Command& command) const {
  if (const auto* append = std::get_if<AppendEvent>(&command); append != nullptr && options_.on_event)
    options_.on_event(append->event);
}

Writer::Place Writer::push(Command command, std::shared_ptr<Waiter> waiter) {
  report_event(command);
  const std::size_t bytes = weight_bytes(command);
  queued_bytes_ += bytes;
  queue_.push_back({++last_id_, std::move(command), bytes, Clock::now(), std::move(waiter)});
  ++status_.posted;
  if (queue_.size() == 1 || queue_.size() >= options_.batch_commands) work_.notify_one();
  const Place item = std::prev(queue_.end());
  forget(*item);  // an earlier one must not overtake this one
  if (item->waiter) return item;
  if (const auto* checkpoint = std::get_if<CheckpointMission>(&item->command))
    checkpoints_[checkpoint->mission.key] = item;
  else if (const auto* put = std::get_if<PutLearned>(&item->command))
    learned_[{put->learned.robot_id, put->learned.topic}] = item;
  return item;
}

void Writer::shed(Command& command) {
  auto* checkpoint = std::get_if<CheckpointMission>(&command);
  if (checkpoint == nullptr) return;
  status_.shed_samples += checkpoint->samples.size();
  checkpoint->samples = {};
  checkpoint->covariates = {};
  checkpoint->trace = {};
}

// Whether a waiting command has taken up this one.
bool Writer::merged(Command& command) {
  Place waiting;
  if (auto* checkpoint = std::get_if<CheckpointMission>(&command)) {
    const auto found = checkpoints_.find(checkpoint->mission.key);
    if (found == checkpoints_.end()) return false;
    waiting = found->second;
    if (std::get<CheckpointMission>(waiting->command).epoch != checkpoint->epoch) return false;
    take_up(std::get<CheckpointMission>(waiting->command), std::move(*checkpoint));
  } else if (auto* put = std::get_if<PutLearned>(&command)) {
    const auto found = learned_.find({put->learned.robot_id, put->learned.topic});
    if (found == learned_.end()) return false;
    waiting = found->second;
    std::get<PutLearned>(waiting->command) = std::move(*put);
  } else {
    return false;
  }
  queued_bytes_ -= waiting->bytes;
  waiting->bytes = weight_bytes(waiting->command);
  queued_bytes_ += waiting->bytes;
  ++status_.posted;
  ++status_.merged;
  return true;
}

// Later commands are no longer merged into the item.
void Writer::forget(const Item& item) {
  if (const auto* checkpoint = std::get_if<CheckpointMission>(&item.command))
    checkpoints_.erase(checkpoint->mission.key);
  else if (const auto* start = std::get_if<StartMission>(&item.command))
    checkpoints_.erase(start->mission.key);
  else if (const auto* put = std::get_if<PutLearned>(&item.command))
    learned_.erase({put->learned.robot_id, put->learned.topic});
}

void Writer::loop() {
  for (bool going = true; going;) {
    survive("store writer", [&] {
      // Items that an exception left in the batch go first.
      going = (!batch_.items.empty() || take_batch()) && commit();
      if (going) prune_when_due();
    });
  }
  const std::lock_guard lock(mutex_);
  if (!ended_) end();
}

// Fills the batch, or leaves it empty as a sign of life. False when stopping and all is done or time is up.
bool Writer::take_batch() {
  std::unique_lock lock(mutex_);
  ++status_.ticks;
  if (queue_.empty()) work_.wait_for(lock, longest_sleep, [this] { return stopping_ || !queue_.empty(); });
  if (ended_) return false;
  if (queue_.empty()) return !stopping_;
  if (stopping_ && Clock::now() >= stop_deadline_) return false;
  work_.wait_until(lock, queue_.front().since + options_.batch_delay, [this] {
    return stopping_ || commit_now_ || queue_.size() >= options_.batch_commands ||
           2 * queued_bytes_ >= options_.queue_bytes;
  });
  const std::size_t count = std::min(queue_.size(), std::max<std::size_t>(options_.batch_commands, 1));
  const auto end = std::next(queue_.begin(), static_cast<std::ptrdiff_t>(count));
  batch_.commands.reserve(count);
  batch_.items.splice(batch_.items.end(), queue_, queue_.begin(), end);
  for (Item& item : batch_.items) {
    forget(item);
    if (item.waiter) item.waiter->queued = false;
    batch_.commands.push_back(std::move(item.command));
  }
  if (queue_.empty()) commit_now_ = false;
  return true;
}

// False when stopping left no time to succeed.
bool Writer::commit() {
  std::chrono::milliseconds pause = options_.retry_first;
  for (;;) {
    const auto begin = Clock::now();
    bool idle = false;
    {
      const std::lock_guard lock(mutex_);
      attempt_since_ = begin;
      idle = batch_.commands.empty() && why_.empty();
    }
    // After a failure an empty transaction tries the store where nothing waits to be committed.
    Result<std::vector<Outcome>> outcomes = std::vector<Outcome>();
    if (!idle) outcomes = store_.apply(batch_.commands);
    if (const Result<void> sound = idle ? store_.check() : Result<void>(); !sound)
      outcomes = tl::unexpected(sound.error());
    if (outcomes) return settle(*outcomes, idle, Seconds(Clock::now() - begin).count());
    if (!wait_before_retry(outcomes.error(), pause)) return false;
    // Pruning frees space on a full disk.
    prune_when_due();
    pause = std::min(2 * pause, options_.retry_last);
  }
}

// A command that a caller waits for is answered as not done, and is not tried again.
void Writer::withdraw_awaited(const Error& why) {
  const auto answer = [&](const Item& item) {
    item.waiter->outcome = tl::unexpected(unavailable(why.message + "; not done"));
    item.waiter->queued = false;
    item.waiter->done.notify_all();
    queued_bytes_ -= item.bytes;
  };
  std::size_t k = 0;
  const bool may_be_done = store_.is_in_doubt();  // then the batch is tried again as it is
  for (auto item = batch_.items.begin(); item != batch_.items.end() && !may_be_done;) {
    if (!item->waiter) {
      ++item, ++k;
      continue;
    }
    answer(*item);
    item = batch_.items.erase(item);
    batch_.commands.erase(batch_.commands.begin() + static_cast<std::ptrdiff_t>(k));
  }
  std::erase_if(queue_, [&](const Item& item) {
    if (item.waiter) answer(item);
    return item.waiter != nullptr;
  });
}

bool Writer::wait_before_retry(const Error& error, std::chrono::milliseconds pause) {
  const auto now = Clock::now();
  const auto until = now + pause;
  std::unique_lock lock(mutex_);
  attempt_since_.reset();
  if (why_.empty()) failing_since_ = now;
  const bool news = why_.empty() || now - told_ >= tell_again;
  why_ = describe(error);
  ++status_.failed_commits;
  withdraw_awaited(error);
  if (news) {
    told_ = now;
    const auto age_s = static_cast<int>(Seconds(now - failing_since_).count());
    lock.unlock();
    tell(age_s == 0 ? error
                    : Error{error.fault, error.field,
                            "has taken no data for " + std::to_string(age_s) + " s: " + error.message});
    lock.lock();
  }
  room_.notify_all();  // execute() refuses now
  for (;;) {
    ++status_.ticks;
    const auto at = Clock::now();
    if (ended_ || (stopping_ && at >= stop_deadline_)) return false;
    if (at >= until) return true;
    // Stopping shortens the pause to the deadline: a failing disk is not retried without pause.
    const auto wake = std::min(until, at + Clock::duration(longest_sleep));
    work_.wait_until(lock, stopping_ ? std::min(wake, stop_deadline_) : wake);
  }
}

// False when stop() did not wait for this any longer.
bool Writer::settle(std::vector<Outcome>& outcomes, bool idle, double duration_s) {
  // Before flush() can return: its caller may expect the reports.
  auto item = batch_.items.begin();
  for (std::size_t k = 0; k < outcomes.size(); ++k) {
    if (const Item& settled = *item++; !outcomes[k] && !settled.waiter) tell(outcomes[k].error());
    if (const auto* done = std::get_if<CommitChange>(&batch_.commands[k]); done != nullptr && outcomes[k])
      for (const Command& followed : done->change->followed) report_event(followed);
    if (const auto* begun = std::get_if<StartMission>(&batch_.commands[k]);
        begun != nullptr && outcomes[k].value_or(0) > 0 && options_.on_reused_name)
      options_.on_reused_name(begun->mission, *outcomes[k]);
    if (const auto* last = std::get_if<CheckpointMission>(&batch_.commands[k]);
        last != nullptr && outcomes[k].value_or(0) > 0 && last->mission.state != MissionState::open &&
        options_.on_mission_ended)  // 0: dropped, as another daemon keeps the robot
      options_.on_mission_ended(last->mission);
  }
  bool recovered = false;
  {
    const std::lock_guard lock(mutex_);
    recovered = !why_.empty() && !ended_;
  }
  if (recovered && options_.on_recovery) options_.on_recovery();
  {
    const std::lock_guard lock(mutex_);
    attempt_since_.reset();
    if (ended_) return false;
    why_.clear();
    if (!idle && !outcomes.empty()) {
      ++status_.commits;
      status_.total_commit_s += duration_s;
    }
    item = batch_.items.begin();
    for (Outcome& outcome : outcomes) {
      ++(outcome ? status_.applied : status_.refused);
      queued_bytes_ -= item->bytes;
      if (item->waiter) {
        item->waiter->outcome = std::move(outcome);
        item->waiter->done.notify_all();
      }
      ++item;
    }
    batch_ = {};
  }
  room_.notify_all();
  committed_.notify_all();
  return true;
}

void Writer::prune_when_due() {
  const auto now = Clock::now();
  if (steps_.take_step_us() != 0) distrust_until_ = now + options_.clock_distrust;
  const Retention& keep = options_.retention;
  const bool by_age = keep.telemetry_max_age_us || options_.missions_max_age_us || options_.audit_max_age_us;
  if (!by_age && !keep.telemetry_max_bytes && !options_.events_kept) return;
  if (options_.prunes && !options_.prunes()) return;
  if (now - last_prune_ < options_.prune_interval) return;
  bool more_is_due = false;
  if (by_age && now >= distrust_until_) prune_by_age(Seconds(now - last_prune_).count() / seconds_per_hour);
  if (keep.telemetry_max_bytes) {
    const Prune by_size{{{}, keep.telemetry_max_bytes}};
    // A full measure means that more is due: after the commands that came meanwhile.
    more_is_due = prune(by_size) == by_size.max_chunks;
  }
  if (options_.events_kept) {
    const PruneEvents events{*options_.events_kept, events_at_once};
    more_is_due |= prune(events) == events.max_events;
  }
  if (!more_is_due) last_prune_ = now;
}

void Writer::prune_by_age(double hours) {
  const Result<StoreSize> size = store_.size();
  if (!size) return tell(size.error());
  // The allowance of an hour, accumulated; of a small store one at least.
  const auto allow = [&](double& allowance, std::int64_t there) {
    const double share = options_.age_share_per_hour * static_cast<double>(there);
    allowance = std::min(allowance + share * hours, std::max(share, 1.0));
    return static_cast<std::int64_t>(allowance);
  };
  const Retention& keep = options_.retention;
  if (keep.telemetry_max_age_us)
    if (const auto most = allow(age_allowance_, size->telemetry_chunks); most >= 1)
      age_allowance_ -= static_cast<double>(prune(Prune{{keep.telemetry_max_age_us, {}}, most}));
  if (options_.missions_max_age_us)
    if (const auto most = allow(mission_allowance_, size->missions); most >= 1)
      mission_allowance_ -= static_cast<double>(prune(PruneMissions{*options_.missions_max_age_us, most}));
  // A removal adds an entry, so that it waits for the allowance of an hour, or for all entries.
  const auto entries = static_cast<double>(size->audit_entries);
  if (options_.audit_max_age_us)
    if (const auto most = allow(audit_allowance_, size->audit_entries);
        most >= 1 && audit_allowance_ >= entries * std::min(options_.age_share_per_hour, 1.0))
      audit_allowance_ -= static_cast<double>(prune(PruneAudit{*options_.audit_max_age_us, most}));
}

// The number of chunks, missions, events or entries dropped.
std::int64_t Writer::prune(const Command& command) {
  const auto outcomes = store_.apply({&command, 1});
  const Outcome outcome = outcomes ? outcomes->front() : Outcome(tl::unexpected(outcomes.error()));
  if (!outcome) {
    tell(outcome.error());
    return 0;
  }
  const std::lock_guard lock(mutex_);
  std::uint64_t& count = std::holds_alternative<Prune>(command)           ? status_.pruned_chunks
                         : std::holds_alternative<PruneMissions>(command) ? status_.pruned_missions
                         : std::holds_alternative<PruneAudit>(command)    ? status_.pruned_audit
                                                                          : status_.pruned_events;
  count += static_cast<std::uint64_t>(*outcome);
  return *outcome;
}

// Answers the callers that wait, and spools the other commands: with the mutex held, once.
void Writer::end() {
  ended_ = true;
  if (why_.empty() && attempt_since_) why_ = trouble().value_or("a commit did not return");
  TakeSpool first{{}, store_.mark()};
  std::vector<const Command*> spooled;
  std::size_t k = 0;
  for (const Item& item : batch_.items) {
    const Command& command = batch_.commands[k++];
    item.waiter ? refuse(*item.waiter, attempt_since_ ? cut_off() : stopping()) : spooled.push_back(&command);
  }
  first.attempted = static_cast<std::int64_t>(spooled.size());
  for (const Item& item : queue_)
    item.waiter ? refuse(*item.waiter, stopping()) : spooled.push_back(&item.command);
  left_ = batch_.items.size() + queue_.size();
  committed_.notify_all();
  if (spooled.empty()) return;
  const std::string number = std::to_string(spooled.size()) + " commands were ";
  Result<void> kept = options_.spool_path.empty() ? Result<void>(tl::unexpected(unavailable(why_)))
                                                  : write_spool(options_.spool_path, first, spooled);
  tell(unavailable(kept ? number + "written to " + options_.spool_path +
                              ", which the next start stores: " + why_
                        : number + "lost at the stop: " + describe(kept.error())));
}

void Writer::refuse(Waiter& waiter, Error why) {
  waiter.outcome = tl::unexpected(std::move(why));
  waiter.queued = false;
  waiter.done.notify_all();
}

}  // namespace joulecast::history
