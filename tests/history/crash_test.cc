// A store's process killed at any moment: no corruption, and no loss of committed data or of data older than
// a second.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <thread>

#include "history/sqlite.h"
#include "history/writer.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

using Clock = std::chrono::steady_clock;  // one clock for parent and child

// Progress that the child reports: the number of samples handed over (or committed) at that time.
struct Progress {
  std::int64_t samples = 0;
  Clock::time_point at;
};

enum class Tells { posted, committed };

constexpr std::int64_t samples_a_checkpoint = 10;

// The child: goes on with the open mission, or starts it, until it is killed.
[[noreturn]] void write_forever(const std::string& path, Tells tells, int pipe) {
  auto store = need(open_store(path));
  const auto open_missions = need(store->recover());
  Writer writer(*store, {});
  Mission m = open_missions.empty() ? new_mission(*store, "amr-1", "m", 0) : open_missions.front();
  if (open_missions.empty()) need(writer.execute(StartMission{m}));
  for (;;) {
    CheckpointMission checkpoint;
    checkpoint.samples = some_samples(10'000 * m.samples, m.samples, samples_a_checkpoint);
    m.samples += samples_a_checkpoint;
    m.accounts.distance_m = static_cast<double>(m.samples);
    checkpoint.mission = m;
    TraceBucket bucket;
    bucket.start_utime_us = m.samples / samples_a_checkpoint * trace_bucket_us;
    checkpoint.trace = {bucket};
    checkpoint.covariates = {{m.samples, "load", m.accounts.distance_m}};
    checkpoint.resume_state = ResumeState{"amr-1", m.samples, m.samples, 0.5, {}};
    if (tells == Tells::committed) {
      need(writer.execute(std::move(checkpoint)));
    } else {
      if (!writer.post(std::move(checkpoint))) _exit(2);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    const Progress progress{m.samples, Clock::now()};
    if (write(pipe, &progress, sizeof progress) != sizeof progress) _exit(3);
  }
}

// Runs the child for that long after its first report, kills it, and returns all its reports.
std::vector<Progress> run_and_kill(const std::string& path, Tells tells, std::chrono::milliseconds life) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) throw std::runtime_error("pipe");
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    try {
      write_forever(path, tells, ends[1]);
    } catch (const std::exception& error) {
      fprintf(stderr, "child: %s\n", error.what());
    }
    _exit(1);
  }
  close(ends[1]);
  std::vector<Progress> told;
  Progress progress;
  bool killed = false;
  while (read(ends[0], &progress, sizeof progress) == sizeof progress) {
    told.push_back(progress);
    if (!killed && progress.at - told.front().at >= life) {
      kill(child, SIGKILL);
      killed = true;
    }
  }
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << "the child ended on its own: " << status;
  return told;
}

// The samples of the one mission; all its parts must agree.
std::int64_t stored_samples(const std::string& path) {
  {
    SqliteDatabase database(path, OpenMode::read_write_create, 1000);
    EXPECT_EQ(database.text("PRAGMA integrity_check"), "ok");
    EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_foreign_key_check"), 0);
  }
  auto store = need(open_store(path));
  const auto missions = need(store->recover());
  EXPECT_EQ(missions.size(), 1U);
  const Mission& m = missions.at(0);
  EXPECT_EQ(m.accounts.distance_m, static_cast<double>(m.samples));
  EXPECT_EQ(need(store->resume_state("amr-1"))->sequence, m.samples);
  EXPECT_EQ(static_cast<std::int64_t>(need(store->trace(m.key, {}, max_trace_points)).buckets.size()),
            m.samples / samples_a_checkpoint);
  std::int64_t next = 0;
  PageRequest page{max_telemetry_samples, {}};
  do {
    const TelemetryPage got = need(store->telemetry(m.key, {}, page));
    for (const auto& sample : got.items) EXPECT_EQ(sample.sequence, next++);
    page.cursor = got.next_cursor;
  } while (!page.cursor.empty());
  EXPECT_EQ(next, m.samples);
  const CovariatePage covariates = need(store->covariates(m.key, {}, {max_telemetry_samples, {}}));
  EXPECT_EQ(static_cast<std::int64_t>(covariates.items.size()), m.samples / samples_a_checkpoint);
  EXPECT_EQ(covariates.items.back().value, m.accounts.distance_m);
  return m.samples;
}

TEST(Crash, LosesNothingThatWasCommitted) {
  const TemporaryFolder folder;
  const std::string path = folder.file("store.db");
  for (const int life_ms : {0, 13, 57, 131, 290}) {
    const auto told = run_and_kill(path, Tells::committed, std::chrono::milliseconds(life_ms));
    ASSERT_FALSE(told.empty());
    EXPECT_GE(stored_samples(path), told.back().samples) << life_ms;
  }
}

TEST(Crash, LosesAtMostOneSecond) {
  const TemporaryFolder folder;
  const std::string path = folder.file("store.db");
  for (const int life_ms : {1100, 1337, 1900}) {
    const auto told = run_and_kill(path, Tells::posted, std::chrono::milliseconds(life_ms));
    ASSERT_FALSE(told.empty());
    const auto end = told.back().at;
    std::int64_t due = 0;
    for (const Progress& progress : told)
      if (end - progress.at >= std::chrono::seconds(1)) due = progress.samples;
    ASSERT_GT(due, 0);
    EXPECT_GE(stored_samples(path), due) << life_ms;
  }
}

}  // namespace
}  // namespace joulecast::history
