#include "history/writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include "history/sqlite.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

using std::chrono::milliseconds;

// A real store whose disk fails while told to.
class FailingStore final : public Store {
 public:
  explicit FailingStore(const std::string& path) {
    SqliteOptions options;
    options.path = path;
    store_ = need(open_sqlite_store(options));
  }

  std::atomic<bool> fails{false};
  std::atomic<int> attempts{0};
  std::atomic<std::size_t> largest_batch{0};

  Result<std::vector<Outcome>> apply(std::span<const Command> commands) override {
    ++attempts;
    if (fails) return fail(Fault::unavailable, "database", "database or disk is full");
    largest_batch = std::max(largest_batch.load(), commands.size());
    return store_->apply(commands);
  }
  Result<MissionKey> mission_key(std::string_view r, std::string_view m, std::int64_t s) override {
    return store_->mission_key(r, m, s);
  }
  Result<std::optional<MissionKey>> earlier_mission(std::string_view r, std::string_view m,
                                                    std::int64_t s) override {
    return store_->earlier_mission(r, m, s);
  }
  Result<std::vector<RobotRecord>> robots() const override { return store_->robots(); }
  Result<ModelVersion> model(std::string_view r, std::optional<std::int64_t> v) const override {
    return store_->model(r, v);
  }
  Result<std::vector<ModelVersion>> model_versions(std::string_view r) const override {
    return store_->model_versions(r);
  }
  Result<Mission> mission(MissionKey key) const override { return store_->mission(key); }
  Result<MissionPage> missions(const MissionFilter& f, const PageRequest& p) const override {
    return store_->missions(f, p);
  }
  Result<Totals> totals(const MissionFilter& f) const override { return store_->totals(f); }
  Result<Trace> trace(MissionKey k, TimeRange r, std::int64_t n) const override {
    return store_->trace(k, r, n);
  }
  Result<CovariatePage> covariates(MissionKey k, TimeRange r, const PageRequest& p) const override {
    return store_->covariates(k, r, p);
  }
  Result<TelemetryPage> telemetry(MissionKey k, TimeRange r, const PageRequest& p) const override {
    return store_->telemetry(k, r, p);
  }
  Result<std::vector<Event>> events(std::int64_t a, std::int64_t n,
                                    std::optional<std::string> r) const override {
    return store_->events(a, n, r);
  }
  Result<std::optional<Learned>> learned(std::string_view r, std::string_view topic) const override {
    return store_->learned(r, topic);
  }
  Result<std::optional<ResumeState>> resume_state(std::string_view r) const override {
    return store_->resume_state(r);
  }
  Result<DiagnosisRecord> diagnosis(std::int64_t id) const override { return store_->diagnosis(id); }
  Result<std::vector<DiagnosisRecord>> diagnoses(std::optional<std::string> r, std::int64_t b,
                                                 std::int64_t n) const override {
    return store_->diagnoses(r, b, n);
  }
  Result<std::string> diagnosis_report(std::int64_t id) const override {
    return store_->diagnosis_report(id);
  }
  Result<Proposal> proposal(std::int64_t id) const override { return store_->proposal(id); }
  Result<std::vector<Proposal>> proposals(std::optional<std::string> r, std::int64_t b,
                                          std::int64_t n) const override {
    return store_->proposals(r, b, n);
  }
  Result<std::vector<Mission>> recover() const override { return store_->recover(); }
  Result<StoreSize> size() const override { return store_->size(); }

 private:
  std::unique_ptr<Store> store_;
};

class WriterTest : public testing::Test {
 protected:
  WriterOptions options() {
    WriterOptions o;
    o.batch_delay = milliseconds(20);
    o.retry_first = milliseconds(1);
    o.retry_last = milliseconds(10);
    o.on_error = [this](const Error& error) {
      std::lock_guard lock(mutex_);
      told_.push_back(error.message);
    };
    return o;
  }

  static Command event(int number) { return AppendEvent{{0, number, "", "test", "{}"}}; }

  std::vector<std::int64_t> stored() {
    std::vector<std::int64_t> numbers;
    std::int64_t after = 0;
    for (;;) {
      const auto events = need(store_.events(after, max_page_size, {}));
      if (events.empty()) return numbers;
      for (const Event& e : events) numbers.push_back(e.utime_us);
      after = events.back().id;
    }
  }

  std::vector<std::string> told() {
    std::lock_guard lock(mutex_);
    return told_;
  }

  template <class Condition>
  static bool eventually(Condition condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(milliseconds(1));
    }
    return true;
  }

  TemporaryFolder folder_;
  FailingStore store_{folder_.file("store.db")};
  std::mutex mutex_;
  std::vector<std::string> told_;
};

std::vector<std::int64_t> numbers_to(int count) {
  std::vector<std::int64_t> numbers;
  for (int i = 0; i < count; ++i) numbers.push_back(i);
  return numbers;
}

TEST_F(WriterTest, CommitsEverythingInOrderAndInBatches) {
  WriterOptions o = options();
  o.batch_commands = 100;
  Writer writer(store_, o);
  for (int i = 0; i < 2500; ++i) ASSERT_TRUE(writer.post(event(i)));
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(stored(), numbers_to(2500));
  const WriterStatus status = writer.status();
  EXPECT_EQ(status.posted, 2500U);
  EXPECT_EQ(status.applied, 2500U);
  EXPECT_EQ(status.queue_commands, 0U);
  EXPECT_EQ(status.queue_bytes, 0U);
  EXPECT_EQ(status.oldest_wait_s, 0.0);
  EXPECT_LE(store_.largest_batch, 100U);
  EXPECT_GE(status.commits, 25U);
  EXPECT_GT(status.max_commit_s, 0.0);
  EXPECT_TRUE(status.healthy);
}

TEST_F(WriterTest, CommitsAfterTheDelayWithoutBeingAsked) {
  Writer writer(store_, options());
  ASSERT_TRUE(writer.post(event(1)));
  EXPECT_TRUE(eventually([&] { return writer.status().commits == 1; }));
}

TEST_F(WriterTest, GathersWhatComesWithinTheDelay) {
  WriterOptions o = options();
  o.batch_delay = milliseconds(300);
  Writer writer(store_, o);
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(writer.post(event(i)));
  EXPECT_TRUE(eventually([&] { return writer.status().applied == 50; }));
  // One, unless this machine stalled for longer than the delay between two posts.
  EXPECT_LE(writer.status().commits, 3U);
}

TEST_F(WriterTest, ExecuteAnswersAtOnceWithTheOutcome) {
  WriterOptions o = options();
  o.batch_delay = std::chrono::minutes(1);
  Writer writer(store_, o);
  EXPECT_EQ(writer.execute(AddModel{"amr-1", 0, ModelOrigin::http, "", "{}", {}}), 1);
  const Outcome refused = writer.execute(ActivateModel{"amr-1", 9});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::not_found);
  EXPECT_EQ(writer.status().refused, 1U);
  EXPECT_TRUE(told().empty());  // who waited for the answer has it
}

TEST_F(WriterTest, TellsOfRefusedCommandsThatNobodyWaitedFor) {
  Writer writer(store_, options());
  ASSERT_TRUE(writer.post(ActivateModel{"amr-1", 9}));
  ASSERT_TRUE(writer.post(event(0)));
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(writer.status().refused, 1U);
  EXPECT_EQ(stored(), numbers_to(1));
  EXPECT_THAT(told(), testing::ElementsAre(testing::HasSubstr("no model version 9")));
}

TEST_F(WriterTest, TriesAgainUntilTheDiskIsWellAndLosesNothing) {
  Writer writer(store_, options());
  store_.fails = true;
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(writer.post(event(i)));
  ASSERT_TRUE(eventually([&] { return writer.status().failed_commits >= 3; }));
  WriterStatus status = writer.status();
  EXPECT_FALSE(status.healthy);
  EXPECT_THAT(status.error, testing::HasSubstr("disk is full"));
  EXPECT_EQ(status.queue_commands, 100U);
  EXPECT_GT(status.oldest_wait_s, 0.0);
  EXPECT_FALSE(writer.flush(milliseconds(20)));
  const Outcome late = writer.execute(event(100), milliseconds(20));
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().fault, Fault::unavailable);

  store_.fails = false;
  ASSERT_TRUE(writer.flush());
  EXPECT_TRUE(writer.status().healthy);
  EXPECT_EQ(stored(), numbers_to(101));
  EXPECT_THAT(told(), testing::Contains(testing::HasSubstr("succeed again")));
}

TEST_F(WriterTest, WaitsOutALockOfAnotherProcess) {
  Database other(folder_.file("store.db"), OpenMode::read_write_create, 100);
  WriterOptions o = options();
  {
    Writer writer(store_, o);
    {
      const Transaction lock(other, Transaction::Kind::write);
      ASSERT_TRUE(writer.post(event(0)));
      // SQLite's own patience (2 s) runs out first.
      ASSERT_TRUE(eventually([&] { return writer.status().failed_commits >= 1; }));
      EXPECT_THAT(writer.status().error, testing::HasSubstr("locked"));
    }
    ASSERT_TRUE(writer.flush());
  }
  EXPECT_EQ(stored(), numbers_to(1));
}

TEST_F(WriterTest, BoundsItsQueueAndCountsWhatItTurnsAway) {
  WriterOptions o = options();
  o.queue_bytes = 20 * weight_bytes(event(0));
  Writer writer(store_, o);
  store_.fails = true;
  int taken = 0;
  Command command = event(taken);
  while (writer.try_post(command)) command = event(++taken);
  // Small texts live inside their strings: all commands weigh the same.
  EXPECT_EQ(taken, 20);
  EXPECT_EQ(std::get<AppendEvent>(command).event.utime_us, 20)
      << "a command turned away stays with its owner";
  EXPECT_EQ(writer.status().overflowed, 1U);
  EXPECT_LE(writer.status().queue_bytes, o.queue_bytes);

  // One that waits for room gets it once the disk is well.
  std::thread poster([&] { EXPECT_TRUE(writer.post(event(20))); });
  store_.fails = false;
  poster.join();
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(stored(), numbers_to(21));
}

TEST_F(WriterTest, TakesACommandHeavierThanTheWholeBound) {
  WriterOptions o = options();
  o.queue_bytes = 1;
  Writer writer(store_, o);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(writer.post(event(i)));
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(stored(), numbers_to(3));
}

TEST_F(WriterTest, StopCommitsWhatWaitsAndTakesNoMore) {
  WriterOptions o = options();
  o.batch_delay = std::chrono::minutes(1);
  Writer writer(store_, o);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(writer.post(event(i)));
  EXPECT_TRUE(writer.stop(std::chrono::seconds(20)));
  EXPECT_EQ(stored(), numbers_to(10));
  EXPECT_FALSE(writer.post(event(10)));
  EXPECT_FALSE(writer.execute(event(10)));
}

TEST_F(WriterTest, StopSaysWhatItCouldNotCommit) {
  Writer writer(store_, options());
  store_.fails = true;
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(writer.post(event(i)));
  Outcome waiting = 0;
  std::thread waiter([&] { waiting = writer.execute(event(10)); });
  ASSERT_TRUE(eventually([&] { return writer.status().posted == 11; }));
  const auto stopped = writer.stop(milliseconds(30));
  waiter.join();
  ASSERT_FALSE(stopped);
  EXPECT_THAT(stopped.error().message, testing::HasSubstr("11 commands"));
  EXPECT_FALSE(waiting);
  EXPECT_THAT(told(), testing::Contains(testing::HasSubstr("11 commands were lost")));
}

TEST_F(WriterTest, TakesCommandsOfManyThreads) {
  WriterOptions o = options();
  o.batch_commands = 37;
  o.queue_bytes = 50 * weight_bytes(event(0));
  Writer writer(store_, o);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 500; ++i) EXPECT_TRUE(writer.post(event(1000 * t + i)));
    });
  for (auto& thread : threads) thread.join();
  ASSERT_TRUE(writer.flush());
  std::vector<std::int64_t> next(4, 0);
  const auto numbers = stored();
  EXPECT_EQ(numbers.size(), 2000U);
  for (const std::int64_t number : numbers) {
    const auto thread = static_cast<std::size_t>(number / 1000);
    EXPECT_EQ(number % 1000, next[thread]++) << "each thread's commands keep their order";
  }
}

TEST_F(WriterTest, EnforcesTheRetention) {
  WriterOptions o = options();
  o.retention.telemetry_max_bytes = 0;
  o.prune_interval = milliseconds(1);
  Mission m = start_mission(store_, "amr-1", "m", 0);
  Writer writer(store_, o);
  m.state = MissionState::finished;
  ASSERT_TRUE(writer.post(CheckpointMission{m, {}, some_samples(0, 0, 5000), {}}));
  ASSERT_TRUE(writer.flush());
  EXPECT_TRUE(eventually([&] { return writer.status().pruned_chunks == 5; }));
  EXPECT_EQ(need(store_.size()).telemetry_bytes, 0);
}

TEST_F(WriterTest, GivesSignsOfLifeWhenIdle) {
  Writer writer(store_, options());
  const std::uint64_t before = writer.status().ticks;
  EXPECT_TRUE(eventually([&] { return writer.status().ticks >= before + 2; }));
}

}  // namespace
}  // namespace joulecast::history
