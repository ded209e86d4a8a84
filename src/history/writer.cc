#include "history/writer.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace joulecast::history {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr std::chrono::milliseconds longest_sleep{1000};

Error stopping() {
  return Error{Fault::unavailable, "store", "the writer is stopping"};
}

}  // namespace

class Writer::Impl {
 public:
  Impl(Store& store, WriterOptions options) : store_(store), options_(std::move(options)) {
    last_prune_ = Clock::now();
    thread_ = std::thread([this] { loop(); });
  }

  ~Impl() {
    if (thread_.joinable()) (void)stop(options_.retry_last);
  }

  Result<void> post(Command command) {
    const std::size_t bytes = weight_bytes(command);
    std::unique_lock lock(mutex_);
    room_.wait(lock, [&] { return stopping_ || has_room(bytes); });
    if (stopping_) return tl::unexpected(stopping());
    push({std::move(command), bytes, Clock::now(), nullptr});
    return {};
  }

  Result<void> try_post(Command& command) {
    const std::size_t bytes = weight_bytes(command);
    std::lock_guard lock(mutex_);
    if (stopping_) return tl::unexpected(stopping());
    if (!has_room(bytes)) {
      ++status_.overflowed;
      return fail(Fault::unavailable, "store", "the writer's queue is full");
    }
    push({std::move(command), bytes, Clock::now(), nullptr});
    return {};
  }

  Outcome execute(Command command, std::chrono::milliseconds timeout) {
    const auto deadline = Clock::now() + timeout;
    const std::size_t bytes = weight_bytes(command);
    auto promise = std::make_shared<std::promise<Outcome>>();
    std::future<Outcome> outcome = promise->get_future();
    {
      std::unique_lock lock(mutex_);
      if (!room_.wait_until(lock, deadline, [&] { return stopping_ || has_room(bytes); }))
        return fail(Fault::unavailable, "store", "the writer's queue is full");
      if (stopping_) return tl::unexpected(stopping());
      push({std::move(command), bytes, Clock::now(), std::move(promise)});
      hurry_ = true;
    }
    work_.notify_one();
    if (outcome.wait_until(deadline) == std::future_status::ready) return outcome.get();
    return fail(Fault::unavailable, "store", "not committed yet; the command stands in the queue");
  }

  Result<void> flush(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    const std::uint64_t target = status_.posted;
    hurry_ = true;
    work_.notify_one();
    if (committed_.wait_for(lock, timeout, [&] { return done_ >= target || ended_; }) && done_ >= target)
      return {};
    return fail(Fault::unavailable, "store",
                std::to_string(target - done_) + " commands are not committed yet" +
                    (status_.healthy ? "" : ": " + status_.error));
  }

  Result<void> stop(std::chrono::milliseconds grace) {
    {
      std::lock_guard lock(mutex_);
      if (!stopping_) stop_deadline_ = Clock::now() + grace;
      stopping_ = true;
    }
    work_.notify_one();
    room_.notify_all();
    if (thread_.joinable()) thread_.join();
    std::lock_guard lock(mutex_);
    const std::uint64_t left = status_.posted - done_;
    if (left == 0) return {};
    return fail(Fault::unavailable, "store",
                std::to_string(left) + " commands were not committed: " + status_.error);
  }

  WriterStatus status() const {
    std::lock_guard lock(mutex_);
    WriterStatus now = status_;
    now.queue_commands = queue_.size() + in_flight_;
    now.queue_bytes = queued_bytes_;
    if (oldest_) now.oldest_wait_s = Seconds(Clock::now() - *oldest_).count();
    return now;
  }

 private:
  struct Item {
    Command command;
    std::size_t bytes = 0;
    Clock::time_point since;
    std::shared_ptr<std::promise<Outcome>> answer;  // null when nobody waits
  };

  struct Batch {
    std::vector<Command> commands;
    std::vector<std::shared_ptr<std::promise<Outcome>>> answers;
    std::size_t bytes = 0;
  };

  // A command heavier than the whole bound passes when it is alone.
  bool has_room(std::size_t bytes) const {
    return queued_bytes_ == 0 || queued_bytes_ + bytes <= options_.queue_bytes;
  }

  void push(Item item) {
    queued_bytes_ += item.bytes;
    if (!oldest_) oldest_ = item.since;
    queue_.push_back(std::move(item));
    ++status_.posted;
    if (queue_.size() == 1 || queue_.size() >= options_.batch_commands) work_.notify_one();
  }

  void loop() {
    for (;;) {
      std::optional<Batch> batch = next_batch();
      if (!batch) break;
      if (!batch->commands.empty() && !commit(*batch)) break;
      prune_when_due();
    }
    end();
  }

  // The next commands to commit; an empty batch as a sign of life; nothing when stopping and all is done or
  // time is up.
  std::optional<Batch> next_batch() {
    std::unique_lock lock(mutex_);
    ++status_.ticks;
    if (queue_.empty()) {
      work_.wait_for(lock, longest_sleep, [this] { return stopping_ || !queue_.empty(); });
    }
    if (queue_.empty()) return stopping_ ? std::nullopt : std::optional<Batch>(Batch{});
    if (stopping_ && Clock::now() >= stop_deadline_) return std::nullopt;
    work_.wait_until(lock, queue_.front().since + options_.batch_delay, [this] {
      return stopping_ || hurry_ || queue_.size() >= options_.batch_commands ||
             2 * queued_bytes_ >= options_.queue_bytes;
    });
    Batch batch;
    const std::size_t count = std::min(queue_.size(), std::max<std::size_t>(options_.batch_commands, 1));
    batch.commands.reserve(count);
    batch.answers.reserve(count);
    oldest_ = queue_.front().since;
    for (std::size_t k = 0; k < count; ++k) {
      Item& item = queue_.front();
      batch.commands.push_back(std::move(item.command));
      batch.answers.push_back(std::move(item.answer));
      batch.bytes += item.bytes;
      queue_.pop_front();
    }
    in_flight_ = count;
    if (queue_.empty()) hurry_ = false;
    return batch;
  }

  // False when stopping left no time to succeed.
  bool commit(Batch& batch) {
    std::chrono::milliseconds pause = options_.retry_first;
    for (;;) {
      const auto begin = Clock::now();
      auto outcomes = store_.apply(batch.commands);
      if (outcomes) {
        settle(batch, *outcomes, Seconds(Clock::now() - begin).count());
        return true;
      }
      tell(outcomes.error());
      if (!wait_before_retry(outcomes.error(), pause)) {
        refuse(batch.answers);
        return false;
      }
      pause = std::min(2 * pause, options_.retry_last);
    }
  }

  static void refuse(const std::vector<std::shared_ptr<std::promise<Outcome>>>& answers) {
    for (const auto& answer : answers)
      if (answer) answer->set_value(tl::unexpected(stopping()));
  }

  bool wait_before_retry(const Error& error, std::chrono::milliseconds pause) {
    const auto until = Clock::now() + pause;
    std::unique_lock lock(mutex_);
    status_.healthy = false;
    status_.error = describe(error);
    ++status_.failed_commits;
    for (;;) {
      ++status_.ticks;
      const auto now = Clock::now();
      if (stopping_ && now >= stop_deadline_) return false;
      if (now >= until) return true;
      // Stopping cuts the pause short to the deadline, not to nothing: a sick disk is not hammered.
      const auto wake = std::min(until, now + Clock::duration(longest_sleep));
      work_.wait_until(lock, stopping_ ? std::min(wake, stop_deadline_) : wake);
    }
  }

  void settle(Batch& batch, std::vector<Outcome>& outcomes, double duration_s) {
    // Before flush() can return: who waits for it may look for what was refused.
    for (std::size_t k = 0; k < outcomes.size(); ++k)
      if (!outcomes[k] && !batch.answers[k]) tell(outcomes[k].error());
    bool recovered = false;
    {
      std::lock_guard lock(mutex_);
      recovered = !status_.healthy;
      status_.healthy = true;
      status_.error.clear();
      ++status_.commits;
      status_.last_commit_s = duration_s;
      status_.max_commit_s = std::max(status_.max_commit_s, duration_s);
      status_.total_commit_s += duration_s;
      done_ += batch.commands.size();
      queued_bytes_ -= batch.bytes;
      in_flight_ = 0;
      oldest_ = queue_.empty() ? std::nullopt : std::optional(queue_.front().since);
      for (const Outcome& outcome : outcomes) ++(outcome ? status_.applied : status_.refused);
    }
    room_.notify_all();
    committed_.notify_all();
    for (std::size_t k = 0; k < outcomes.size(); ++k)
      if (batch.answers[k]) batch.answers[k]->set_value(std::move(outcomes[k]));
    if (recovered) tell({Fault::unavailable, "store", "commits succeed again"});
  }

  void prune_when_due() {
    const Retention& keep = options_.retention;
    if (!keep.telemetry_max_age_us && !keep.telemetry_max_bytes) return;
    if (Clock::now() - last_prune_ < options_.prune_interval) return;
    const Command prune = Prune{keep};
    const auto outcomes = store_.apply({&prune, 1});
    const Outcome outcome = outcomes ? outcomes->front() : Outcome(tl::unexpected(outcomes.error()));
    if (!outcome) {
      last_prune_ = Clock::now();
      tell(outcome.error());
      return;
    }
    // A full measure means that more is due: after the commands that came meanwhile.
    if (*outcome < std::get<Prune>(prune).max_chunks) last_prune_ = Clock::now();
    std::lock_guard lock(mutex_);
    status_.pruned_chunks += static_cast<std::uint64_t>(*outcome);
  }

  void end() {
    std::uint64_t left = 0;
    std::string why;
    std::vector<std::shared_ptr<std::promise<Outcome>>> unanswered;
    {
      std::lock_guard lock(mutex_);
      ended_ = true;
      left = status_.posted - done_;
      why = status_.error;
      for (Item& item : queue_) unanswered.push_back(std::move(item.answer));
      queue_.clear();
    }
    refuse(unanswered);
    committed_.notify_all();
    if (left > 0)
      tell({Fault::unavailable, "store", std::to_string(left) + " commands were lost at the stop: " + why});
  }

  void tell(const Error& error) const {
    if (options_.on_error) options_.on_error(error);
  }

  Store& store_;
  const WriterOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable work_;       // for the writing thread
  std::condition_variable room_;       // for those who wait to post
  std::condition_variable committed_;  // for those who flush
  std::deque<Item> queue_;
  std::size_t queued_bytes_ = 0;  // waiting and in flight
  std::size_t in_flight_ = 0;
  std::uint64_t done_ = 0;  // commands committed or refused
  std::optional<Clock::time_point> oldest_;
  bool hurry_ = false;  // somebody waits: commit what there is
  bool stopping_ = false;
  bool ended_ = false;
  Clock::time_point stop_deadline_;
  WriterStatus status_;
  Clock::time_point last_prune_;  // the writing thread's own

  std::thread thread_;
};

Writer::Writer(Store& store, WriterOptions options)
    : impl_(std::make_unique<Impl>(store, std::move(options))) {}

Writer::~Writer() = default;

Result<void> Writer::post(Command command) {
  return impl_->post(std::move(command));
}

Result<void> Writer::try_post(Command& command) {
  return impl_->try_post(command);
}

Outcome Writer::execute(Command command, std::chrono::milliseconds timeout) {
  return impl_->execute(std::move(command), timeout);
}

Result<void> Writer::flush(std::chrono::milliseconds timeout) {
  return impl_->flush(timeout);
}

Result<void> Writer::stop(std::chrono::milliseconds grace) {
  return impl_->stop(grace);
}

WriterStatus Writer::status() const {
  return impl_->status();
}

}  // namespace joulecast::history
