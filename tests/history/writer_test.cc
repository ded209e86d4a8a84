#include "history/writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <thread>

#include "history/spool.h"
#include "history/sqlite.h"
#include "tests/history/forwarding_store.h"

namespace joulecast::history {
namespace {

using std::chrono::milliseconds;

// A real store with a disk that fails on request.
class FailingStore final : public ForwardingStore {
 public:
  explicit FailingStore(const std::string& path) : ForwardingStore(open_at(path)) {
    need(store_->apply({}));  // as take_in_spool() does at a start
  }

  std::atomic<bool> fails{false};
  std::atomic<bool> drops{false};  // as of robots that another daemon keeps
  std::atomic<bool> hangs{false};
  std::atomic<bool> lost{false};
  std::atomic<int> attempts{0};
  std::atomic<std::size_t> largest_batch{0};

  Result<std::vector<Outcome>> apply(std::span<const Command> commands) override {
    ++attempts;
    while (hangs) std::this_thread::sleep_for(milliseconds(1));
    if (fails) return fail(Fault::unavailable, "database", "database or disk is full");
    if (drops) return std::vector<Outcome>(commands.size(), 0);
    largest_batch = std::max(largest_batch.load(), commands.size());
    const std::lock_guard lock(applying_);
    return store_->apply(commands);
  }
  BatchMark mark() const override {
    const std::lock_guard lock(applying_);
    return store_->mark();
  }
  Result<void> check() override {
    if (lost) return fail(Fault::unavailable, "database", "was deleted");
    return {};
  }

 private:
  mutable std::mutex applying_;  // a commit that hung may end while the test applies another
};

class WriterTest : public ::testing::Test {
 protected:
  WriterOptions options() {
    WriterOptions o;
    o.batch_delay = milliseconds(20);
    o.retry_first = milliseconds(1);
    o.retry_last = milliseconds(10);
    o.on_recovery = [this] {
      std::lock_guard lock(mutex_);
      told_.push_back("recovered");
    };
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

TEST_F(WriterTest, CommitsInOrderedBatches) {
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
  EXPECT_GT(status.total_commit_s, 0.0);
  EXPECT_TRUE(status.healthy);
}

TEST_F(WriterTest, CommitsAfterTheDelay) {
  Writer writer(store_, options());
  ASSERT_TRUE(writer.post(event(1)));
  EXPECT_TRUE(eventually([&] { return writer.status().commits == 1; }));
}

TEST_F(WriterTest, BatchesCommandsWithinTheDelay) {
  WriterOptions o = options();
  o.batch_delay = milliseconds(300);
  Writer writer(store_, o);
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(writer.post(event(i)));
  EXPECT_TRUE(eventually([&] { return writer.status().applied == 50; }));
  // One, unless this machine stalled for longer than the delay between two posts.
  EXPECT_LE(writer.status().commits, 3U);
}

TEST_F(WriterTest, ExecuteReturnsTheOutcomeImmediately) {
  WriterOptions o = options();
  o.batch_delay = std::chrono::minutes(1);
  Writer writer(store_, o);
  EXPECT_EQ(writer.execute(AddModel{"amr-1", 0, ModelOrigin::http, "", "{}", {}}), 1);
  const Outcome refused = writer.execute(ActivateModel{"amr-1", 9});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::not_found);
  EXPECT_EQ(writer.status().refused, 1U);
  EXPECT_TRUE(told().empty());  // the waiting caller has the answer
}

TEST_F(WriterTest, ReportsRefusedPostedCommands) {
  Writer writer(store_, options());
  ASSERT_TRUE(writer.post(ActivateModel{"amr-1", 9}));
  ASSERT_TRUE(writer.post(event(0)));
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(writer.status().refused, 1U);
  EXPECT_EQ(stored(), numbers_to(1));
  EXPECT_THAT(told(), ::testing::ElementsAre(::testing::HasSubstr("no model version 9")));
}

TEST_F(WriterTest, RetriesUntilTheDiskWorks) {
  Writer writer(store_, options());
  store_.fails = true;
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(writer.post(event(i)));
  ASSERT_TRUE(eventually([&] { return writer.status().failed_commits >= 3; }));
  WriterStatus status = writer.status();
  EXPECT_FALSE(status.healthy);
  EXPECT_THAT(status.error, ::testing::HasSubstr("disk is full"));
  EXPECT_EQ(status.queue_commands, 100U);
  EXPECT_GT(status.oldest_wait_s, 0.0);
  EXPECT_FALSE(writer.flush(milliseconds(20)));
  const Outcome refused = writer.execute(event(100));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::unavailable);

  store_.fails = false;
  ASSERT_TRUE(writer.flush());
  EXPECT_TRUE(writer.status().healthy);
  EXPECT_EQ(stored(), numbers_to(100)) << "a command reported as unavailable is not done later";
  EXPECT_THAT(told(), ::testing::Contains(::testing::Eq("recovered")));
}

TEST_F(WriterTest, WaitsForOtherProcessesLocks) {
  SqliteDatabase other(folder_.file("store.db"), OpenMode::read_write_create, 100);
  WriterOptions o = options();
  {
    Writer writer(store_, o);
    {
      const Transaction lock(other, Database::Access::write);
      ASSERT_TRUE(writer.post(event(0)));
      // SQLite's own timeout (2 s) expires first.
      ASSERT_TRUE(eventually([&] { return writer.status().failed_commits >= 1; }));
      EXPECT_THAT(writer.status().error, ::testing::HasSubstr("locked"));
    }
    ASSERT_TRUE(writer.flush());
  }
  EXPECT_EQ(stored(), numbers_to(1));
}

TEST_F(WriterTest, PostWaitsForRoom) {
  WriterOptions o = options();
  o.queue_bytes = 20 * weight_bytes(event(0));
  Writer writer(store_, o);
  store_.fails = true;
  // Small texts live inside their strings: all commands weigh the same.
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(writer.post(event(i)));
  EXPECT_LE(writer.status().queue_bytes, writer.status().queue_limit_bytes);
  std::atomic<bool> posted = false;
  std::thread poster([&] {
    EXPECT_TRUE(writer.post(event(20)));
    posted = true;
  });
  std::this_thread::sleep_for(milliseconds(50));
  EXPECT_FALSE(posted);
  store_.fails = false;
  poster.join();
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(stored(), numbers_to(21));
}

TEST_F(WriterTest, OffersMergeDuringAStall) {
  Mission m = start_mission(store_, "amr-1", "m", 0);
  Writer writer(store_, options());
  store_.fails = true;
  ASSERT_TRUE(writer.offer(event(0)));
  ASSERT_TRUE(eventually([&] { return writer.status().failed_commits > 0; }));
  for (int k = 0; k < 400; ++k) {
    m.samples += 25;
    ASSERT_TRUE(writer.offer(CheckpointMission{m, {}, some_samples(1'000'000 * k, 25 * k, 25), {}}));
    ASSERT_TRUE(writer.offer(PutLearned{{"amr-1", "charge", k, "{}"}}));
  }
  EXPECT_LE(writer.status().queue_commands, 3U);
  EXPECT_EQ(writer.status().merged, 798U);
  store_.fails = false;
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(writer.status().queue_bytes, 0U);
  EXPECT_EQ(need(store_.mission(m.key)).samples, 10'000);
  EXPECT_EQ(need(store_.learned("amr-1", "charge"))->utime_us, 399);
  const auto page = need(store_.telemetry(m.key, {}, {.limit = 20'000, .cursor = {}}));
  ASSERT_EQ(page.items.size(), 10'000U);
  for (std::size_t k = 0; k < page.items.size(); ++k)
    ASSERT_EQ(page.items[k].sequence, static_cast<std::int64_t>(k));
}

TEST_F(WriterTest, RestartSeparatesMergedCheckpoints) {
  Mission m = start_mission(store_, "amr-1", "m", 0);
  Writer writer(store_, options());
  store_.fails = true;
  ASSERT_TRUE(writer.offer(event(0)));
  ASSERT_TRUE(eventually([&] { return writer.status().failed_commits > 0; }));
  ASSERT_TRUE(writer.offer(CheckpointMission{m, {}, some_samples(0, 0, 25), {}}));
  ASSERT_TRUE(writer.offer(StartMission{m}));
  m.samples = 10;
  ASSERT_TRUE(writer.offer(CheckpointMission{m, {}, some_samples(0, 0, 10), {}}));
  store_.fails = false;
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(need(store_.telemetry(m.key, {}, {.limit = 100, .cursor = {}})).items.size(), 10U);
}

TEST_F(WriterTest, FullQueueShedsSamplesOnly) {
  WriterOptions o = options();
  o.queue_bytes = 100'000;
  Mission m = start_mission(store_, "amr-1", "m", 0);
  Writer writer(store_, o);
  store_.fails = true;
  for (int k = 0; k < 400; ++k) {
    m.samples += 25;
    ASSERT_TRUE(writer.offer(CheckpointMission{m, {}, some_samples(1'000'000 * k, 25 * k, 25), {}}));
    ASSERT_LE(writer.status().queue_bytes, o.queue_bytes + 50'000);
  }
  store_.fails = false;
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(need(store_.mission(m.key)).samples, 10'000);
  const auto page = need(store_.telemetry(m.key, {}, {.limit = 20'000, .cursor = {}}));
  EXPECT_GT(page.items.size(), 100U);
  EXPECT_EQ(page.items.size() + writer.status().shed_samples, 10'000U);
}

TEST_F(WriterTest, ExecuteWithdrawsLateCommands) {
  Writer writer(store_, options());
  store_.hangs = true;
  ASSERT_TRUE(writer.offer(event(0)));
  ASSERT_TRUE(eventually([&] { return writer.status().attempt_s > 0; }));
  const Outcome late = writer.execute(event(1), milliseconds(20));
  ASSERT_FALSE(late);
  EXPECT_THAT(late.error().message, ::testing::HasSubstr("not done"));
  store_.hangs = false;
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(stored(), numbers_to(1));
}

TEST_F(WriterTest, ExecuteWaitsForARunningAttempt) {
  Writer writer(store_, options());
  store_.hangs = true;
  std::thread disk([&] {
    std::this_thread::sleep_for(milliseconds(6000));  // the store counts as stalled by then
    store_.hangs = false;
  });
  EXPECT_TRUE(writer.execute(event(0), milliseconds(1000)));
  disk.join();
  EXPECT_EQ(stored(), numbers_to(1));
}

TEST_F(WriterTest, InterruptedAttemptHasUnknownOutcome) {
  Writer writer(store_, options());
  store_.hangs = true;
  Outcome cut = 0;
  std::thread caller([&] { cut = writer.execute(event(0)); });
  ASSERT_TRUE(eventually([&] { return writer.status().attempt_s > 0; }));
  EXPECT_FALSE(writer.stop(milliseconds(10)));
  caller.join();
  ASSERT_FALSE(cut);
  EXPECT_THAT(cut.error().message, ::testing::HasSubstr("shows whether it was done"));
  EXPECT_THAT(cut.error().message, ::testing::Not(::testing::HasSubstr("not done")));
  store_.hangs = false;
}

TEST_F(WriterTest, FailedAttemptIsNotRepeated) {
  Writer writer(store_, options());
  store_.fails = true;
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_FALSE(writer.execute(event(0)));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
  store_.fails = false;
  // The queue is empty, and the writer detects on its own that the store works again.
  EXPECT_TRUE(eventually([&] { return writer.status().healthy; }));
  EXPECT_EQ(writer.execute(event(0)), 1);
  EXPECT_EQ(stored(), numbers_to(1));
}

TEST_F(WriterTest, DetectsALostIdleStore) {
  Writer writer(store_, options());
  store_.lost = true;
  EXPECT_TRUE(eventually([&] { return !writer.status().healthy; }));
  EXPECT_THAT(writer.status().error, ::testing::HasSubstr("was deleted"));
}

TEST_F(WriterTest, AcceptsOneOversizedCommand) {
  WriterOptions o = options();
  o.queue_bytes = 1;
  Writer writer(store_, o);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(writer.post(event(i)));
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(stored(), numbers_to(3));
}

TEST_F(WriterTest, StopCommitsTheQueue) {
  WriterOptions o = options();
  o.batch_delay = std::chrono::minutes(1);
  Writer writer(store_, o);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(writer.post(event(i)));
  EXPECT_TRUE(writer.stop(std::chrono::seconds(20)));
  EXPECT_EQ(stored(), numbers_to(10));
  EXPECT_FALSE(writer.post(event(10)));
  EXPECT_FALSE(writer.execute(event(10)));
}

TEST_F(WriterTest, NextStartAppliesTheSpool) {
  const std::string spool = folder_.file("store.db.spool");
  Mission m = start_mission(store_, "amr-1", "m", 0);
  {
    WriterOptions o = options();
    o.spool_path = spool;
    Writer writer(store_, o);
    store_.fails = true;
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(writer.post(event(i)));
    m.note = "spooled";
    m.samples = 30;
    m.sample_faults["late"] = 2;
    m.accounts.ledger[signals::Term::copper] = 3.5;
    CovariateSummary load;
    load.name = "cpu_load";
    load.mean = 0.25;
    m.covariates.push_back(load);
    TraceBucket bucket;
    bucket.start_utime_us = trace_bucket_us;
    bucket.speed_m_s.max = 1.5;
    ResumeState charge;
    charge.robot_id = "amr-1";
    charge.state_of_charge = 0.5;
    ASSERT_TRUE(writer.offer(
        CheckpointMission{m, {bucket}, some_samples(0, 0, 30), charge, {{7, "cpu_load", 0.25}}}));
    const auto stopped = writer.stop(milliseconds(30));
    ASSERT_FALSE(stopped);
    EXPECT_THAT(stopped.error().message, ::testing::HasSubstr("11 commands"));
    EXPECT_THAT(told(), ::testing::Contains(::testing::HasSubstr("11 commands were written to")));
  }
  store_.fails = false;
  const auto refused = [](const Error& error) { ADD_FAILURE() << describe(error); };
  EXPECT_EQ(need(take_in_spool(spool, store_, refused)).commands, 11U);
  EXPECT_EQ(stored(), numbers_to(10));
  const Mission stored_mission = need(store_.mission(m.key));
  EXPECT_EQ(stored_mission.note, "spooled");
  EXPECT_EQ(stored_mission.sample_faults, m.sample_faults);
  EXPECT_EQ(stored_mission.accounts.ledger[signals::Term::copper], 3.5);
  ASSERT_EQ(stored_mission.covariates.size(), 1U);
  EXPECT_EQ(stored_mission.covariates[0].mean, 0.25);
  EXPECT_EQ(need(store_.telemetry(m.key, {}, {.limit = 100, .cursor = {}})).items.size(), 30U);
  EXPECT_EQ(need(store_.trace(m.key, {}, 10)).buckets.at(0).speed_m_s.max, 1.5);
  EXPECT_EQ(need(store_.covariates(m.key, {}, {.limit = 10, .cursor = {}})).items.at(0).name, "cpu_load");
  EXPECT_EQ(need(store_.resume_state("amr-1"))->state_of_charge, 0.5);
  EXPECT_EQ(need(take_in_spool(spool, store_, refused)).commands, 0U) << "taken in once";
}

TEST_F(WriterTest, DamagedSpoolIsKept) {
  const std::string spool = folder_.file("store.db.spool");
  const Command command = event(0);
  const Command* const commands[] = {&command};
  ASSERT_TRUE(write_spool(spool, TakeSpool{{}, store_.mark()}, commands));
  std::filesystem::resize_file(spool, std::filesystem::file_size(spool) - 1);
  const auto taken = take_in_spool(spool, store_, [](const Error&) {});
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().fault, Fault::corrupt);
  EXPECT_TRUE(std::filesystem::exists(spool + ".refused-1"));
}

TEST_F(WriterTest, StopReturnsDespiteHangingCommit) {
  const std::string spool = folder_.file("store.db.spool");
  WriterOptions o = options();
  o.spool_path = spool;
  Writer writer(store_, o);
  store_.hangs = true;
  ASSERT_TRUE(writer.post(event(0)));
  ASSERT_TRUE(eventually([&] { return writer.status().attempt_s > 0; }));
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_FALSE(writer.stop(milliseconds(30)));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(8));
  const auto commands = need(read_spool(spool));
  ASSERT_EQ(commands.size(), 2U);
  EXPECT_EQ(std::get<TakeSpool>(commands[0]).attempted, 1) << "the commit that hangs may succeed yet";
  // It does, and the spool adds nothing to it.
  store_.hangs = false;
  ASSERT_TRUE(eventually([&] { return stored().size() == 1; }));
  EXPECT_EQ(need(take_in_spool(spool, store_, [](const Error&) {})).already, 1U);
  EXPECT_EQ(stored().size(), 1U);
}

TEST_F(WriterTest, ReportsEventsOfAChange) {
  std::vector<std::string> kinds;
  WriterOptions o = options();
  o.on_event = [&](const Event& event) { kinds.push_back(event.kind); };
  Writer writer(store_, o);
  Change change;
  change.follow = [](std::int64_t) { return std::vector<Command>{event(7)}; };
  EXPECT_EQ(need(writer.execute(change)), 0);
  change.command = ActivateModel{"absent", 1};
  EXPECT_FALSE(writer.execute(change));
  EXPECT_EQ(kinds.size(), 1U) << "of the accepted change alone";
  EXPECT_EQ(stored(), std::vector<std::int64_t>{7});
}

TEST_F(WriterTest, ReportsEachEndedMission) {
  std::vector<Mission> ended;
  WriterOptions o = options();
  o.on_mission_ended = [&](const Mission& mission) { ended.push_back(mission); };
  Mission m = start_mission(store_, "amr-1", "m", 0);
  Writer writer(store_, o);
  store_.fails = true;
  ASSERT_TRUE(writer.offer(CheckpointMission{m, {}, {}, {}}));
  m.state = MissionState::finished;
  m.samples = 10;
  ASSERT_TRUE(writer.offer(CheckpointMission{m, {}, {}, {}}));
  ASSERT_TRUE(eventually([&] { return writer.status().failed_commits > 0; }));
  EXPECT_TRUE(ended.empty()) << "not committed yet";
  store_.fails = false;
  ASSERT_TRUE(writer.flush());
  ASSERT_EQ(ended.size(), 1U);
  EXPECT_EQ(ended[0].key, m.key);
  EXPECT_EQ(ended[0].samples, 10);
  store_.drops = true;
  ASSERT_TRUE(writer.offer(CheckpointMission{m, {}, {}, {}}));
  ASSERT_TRUE(writer.flush());
  EXPECT_EQ(ended.size(), 1U) << "not stored";
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

class AgeTest : public WriterTest {
 protected:
  // Twenty sealed chunks, stored long ago by the host's clock, and the writer that prunes them by age.
  WriterOptions aged() {
    Mission m = start_mission(store_, "amr-1", "m", 0);
    m.state = MissionState::finished;
    const Command checkpoint = CheckpointMission{m, {}, some_samples(0, 0, 20 * 1024), {}};
    EXPECT_TRUE(store_.apply({&checkpoint, 1}));
    chunks_ = need(store_.size()).telemetry_chunks;
    WriterOptions o = options();
    o.retention.telemetry_max_age_us = -1;  // everything is too old
    o.prune_interval = milliseconds(1);
    o.wall_clock = [this] { return wall_us_.load(); };
    o.steady_clock = [this] { return steady_us_.load(); };
    return o;
  }
  std::int64_t left() { return need(store_.size()).telemetry_chunks; }

  std::int64_t chunks_ = 0;
  std::atomic<std::int64_t> wall_us_{1'700'000'000'000'000}, steady_us_{5'000'000};
};

TEST_F(AgeTest, WrongClockPrunesSlowly) {
  WriterOptions o = aged();
  ASSERT_EQ(chunks_, 20);
  Writer writer(store_, o);  // 5 % of 20 chunks in an hour are one, and not before it has passed
  std::this_thread::sleep_for(std::chrono::seconds(3));
  EXPECT_EQ(left(), chunks_);
}

TEST_F(AgeTest, PrunesAtTheAllowedRate) {
  WriterOptions o = aged();
  o.age_share_per_hour = 3600;  // all of it in a second
  Writer writer(store_, o);
  EXPECT_TRUE(eventually([&] { return left() == 0; }));
}

TEST_F(AgeTest, PrunesTheAuditByAge) {
  for (int k = 0; k < 40; ++k)
    need(apply_one(store_, AppendAudit{{0, 1, "carol", "", "", "putRobot", "{}", ""}}));
  WriterOptions o = aged();
  o.retention = {};
  o.audit_max_age_us = 0;
  o.age_share_per_hour = 3600;  // all of it in a second, at once
  Writer writer(store_, o);
  EXPECT_TRUE(eventually([&] { return writer.status().pruned_audit > 0; }));
  EXPECT_EQ(writer.status().pruned_audit, 40U);
  EXPECT_EQ(need(store_.size()).audit_entries, 1) << "the statement";
}

TEST_F(AgeTest, ClockStepPausesPruning) {
  WriterOptions o = aged();
  o.age_share_per_hour = 360;
  Writer writer(store_, o);
  wall_us_ += std::int64_t{60} * 86'400 * 1'000'000;
  std::this_thread::sleep_for(std::chrono::seconds(4));
  const std::int64_t after_step = left();
  EXPECT_GE(after_step, chunks_ - 3) << "at most those pruned before the step was detected";
  std::this_thread::sleep_for(std::chrono::seconds(3));
  EXPECT_EQ(left(), after_step);
}

TEST(ClockStepsTest, DetectsStepsOnly) {
  std::int64_t wall_us = 1'700'000'000'000'000, steady_us = 7;
  ClockSteps steps([&] { return wall_us; }, [&] { return steady_us; });
  const auto pass = [&](std::int64_t us) { wall_us += us, steady_us += us; };
  pass(3'600'000'000);
  EXPECT_EQ(steps.take_step_us(), 0);
  wall_us -= 3'600'000'000;
  EXPECT_EQ(steps.take_step_us(), -3'600'000'000);
  pass(1'000'000);
  EXPECT_EQ(steps.take_step_us(), 0) << "reported once";
  wall_us += 400;  // slewing
  EXPECT_EQ(steps.take_step_us(), 0);
}

TEST_F(WriterTest, TicksWhenIdle) {
  Writer writer(store_, options());
  const std::uint64_t before = writer.status().ticks;
  EXPECT_TRUE(eventually([&] { return writer.status().ticks >= before + 2; }));
}

}  // namespace
}  // namespace joulecast::history
