// Properties of the store in PostgreSQL only: its lock, lost connections, a server that stops and starts.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <set>
#include <thread>

#include "history/open_store.h"
#include "history/postgres.h"
#include "history/writer.h"
#include "postgres_server.h"

namespace joulecast::history {
namespace {

using std::chrono::milliseconds;

class PostgresStoreTest : public ::testing::Test {
 protected:
  Result<std::unique_ptr<Store>> open() const {
    return open_store(postgres_url(folder_), {.lock_wait = milliseconds(200)});
  }
  std::string administer(const std::string& sql) const { return as_administrator(folder_, sql); }
  void end_connections() const {
    administer(
        "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name LIKE 'joulecast-%'");
  }
  void TearDown() override { start_postgres(); }
  std::int64_t stored_events() const { return std::stoll(administer("SELECT count(*)::text FROM event")); }

  TemporaryFolder folder_;
};

Command an_event() {
  return AppendEvent{{0, 1, "", "test", "{}"}};
}

// Tries until it succeeds, as the writer does.
std::vector<Outcome> apply_until_done(Store& store, std::span<const Command> commands) {
  for (int tries = 0; tries < 500; ++tries) {
    auto outcomes = store.apply(commands);
    if (outcomes) return *outcomes;
    EXPECT_EQ(outcomes.error().fault, Fault::unavailable) << describe(outcomes.error());
    std::this_thread::sleep_for(milliseconds(20));
  }
  throw std::runtime_error("the store takes no data");
}

TEST_F(PostgresStoreTest, IsLockedByOneProgram) {
  auto store = need(open());
  const auto second = open();
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().fault, Fault::conflict);
  EXPECT_NE(second.error().message.find("another joulecast program"), std::string::npos);
  store.reset();
  EXPECT_TRUE(open());
}

TEST_F(PostgresStoreTest, RefusesANewerSchema) {
  need(open()).reset();
  administer("UPDATE joulecast_store SET schema_version = 1000");
  const auto store = open();
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().fault, Fault::conflict);
  EXPECT_NE(store.error().message.find("newer"), std::string::npos);
}

TEST_F(PostgresStoreTest, ReportsMissingServer) {
  for (const char* url :
       {"postgresql://nobody@/nothing?host=/nonexistent", "postgresql://nobody@127.0.0.1:1/x"}) {
    const auto store = open_store(url);
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().fault, Fault::unavailable);
  }
  EXPECT_EQ(open_store("mysql://x").error().fault, Fault::invalid);
}

TEST_F(PostgresStoreTest, ReconnectsAfterLostConnections) {
  auto store = need(open());
  Mission m = start_mission(*store, "amr-1", "m", 0);
  for (int k = 0; k < 5; ++k) {
    end_connections();
    m.samples += 10;
    const Command checkpoint = CheckpointMission{m, {}, some_samples(100'000 * k, 10 * k, 10), {}};
    ASSERT_TRUE(apply_until_done(*store, {&checkpoint, 1}).front());
    // Every reading connection was ended too.
    EXPECT_EQ(need(store->mission(m.key)).samples, m.samples);
  }
  EXPECT_EQ(need(store->telemetry(m.key, {}, {1000, {}})).items.size(), 50U);
}

// Of accounting, which begins missions, and of a commit.
TEST_F(PostgresStoreTest, LockedTableDelaysBriefly) {
  auto store = need(open());
  PostgresDatabase other(postgres_url(folder_), "other");
  other.execute("BEGIN; LOCK TABLE mission IN ACCESS EXCLUSIVE MODE");
  const auto begun = std::chrono::steady_clock::now();
  std::set<MissionKey> keys;
  for (int k = 0; k < 20; ++k) keys.insert(need(store->new_mission_key()));
  EXPECT_EQ(keys.size(), 20U);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, milliseconds(500)) << "accounting does not wait";
  const Command start = StartMission{new_mission(*store, "amr-1", "m0", 0)};
  const auto refused = store->apply({&start, 1});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::unavailable);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, milliseconds(15'000)) << "2 s are waited";
  other.execute("ROLLBACK");
  EXPECT_TRUE(need(store->apply({&start, 1})).front());
}

TEST_F(PostgresStoreTest, ServerRestartLosesNothing) {
  auto store = need(open());
  WriterOptions options;
  options.retry_last = milliseconds(100);
  Writer writer(*store, options);
  Mission m = start_mission(*store, "amr-1", "m", 0);
  stop_postgres();
  for (int k = 0; k < 20; ++k) {
    m.samples += 10;
    EXPECT_TRUE(writer.offer(CheckpointMission{m, {}, some_samples(100'000 * k, 10 * k, 10), {}}));
  }
  // A mission that begins meanwhile has its key.
  Mission later = new_mission(*store, "amr-1", "later", 5);
  EXPECT_GT(later.key, m.key);
  EXPECT_TRUE(writer.offer(StartMission{later}));
  EXPECT_FALSE(writer.execute(an_event(), milliseconds(300)));
  EXPECT_EQ(store->mission(m.key).error().fault, Fault::unavailable);
  EXPECT_FALSE(writer.status().healthy);
  start_postgres();
  EXPECT_TRUE(writer.flush());
  EXPECT_TRUE(writer.status().healthy);
  std::this_thread::sleep_for(milliseconds(1100));  // a reading connection is not tried more often
  EXPECT_EQ(need(store->telemetry(m.key, {}, {1000, {}})).items.size(), 200U);
  EXPECT_EQ(need(store->mission(later.key)).mission_id, "later");
  EXPECT_EQ(stored_events(), 0);  // the outcome reported to its sender: not done
}

// Runs the batch while its COMMIT is held up by a deferred trigger that waits for an advisory lock.
class SlowCommit {
 public:
  SlowCommit(const TemporaryFolder& folder) : holder_(postgres_url(folder), "holder") {
    holder_.execute("SELECT pg_advisory_lock(42)");
    holder_.execute(
        "CREATE FUNCTION wait_at_commit() RETURNS trigger LANGUAGE plpgsql AS $$BEGIN PERFORM "
        "pg_advisory_lock_shared(42); RETURN NULL; END$$");
    holder_.execute(
        "CREATE CONSTRAINT TRIGGER wait_at_commit AFTER INSERT ON event DEFERRABLE INITIALLY DEFERRED FOR "
        "EACH ROW "
        "EXECUTE FUNCTION wait_at_commit()");
  }
  void let_go() { holder_.execute("SELECT pg_advisory_unlock(42)"); }

 private:
  PostgresDatabase holder_;
};

TEST_F(PostgresStoreTest, InterruptedCommitIsAppliedOnce) {
  auto store = need(open());
  const std::vector<Command> batch = {an_event(), an_event()};
  need(store->apply(batch));
  SlowCommit slow(folder_);
  std::atomic<bool> done = false;
  std::thread applying([&] {
    EXPECT_EQ(apply_until_done(*store, batch).size(), 2U);
    done = true;
  });
  // The COMMIT waits: its connection is ended there, so it is rolled back and tried again.
  const std::string waiting =
      "SELECT count(*)::text FROM pg_stat_activity WHERE query = 'COMMIT' AND state = 'active' AND "
      "wait_event = "
      "'advisory'";
  for (int ended = 0; ended < 3;) {
    ASSERT_FALSE(done);
    if (administer(waiting) != "0") {
      end_connections();
      ++ended;
    }
    std::this_thread::sleep_for(milliseconds(10));
  }
  slow.let_go();
  applying.join();
  EXPECT_EQ(stored_events(), 4);
}

// A relay between the store and the server, which can keep the answer of the next COMMIT to itself.
class Relay {
 public:
  explicit Relay(const std::string& server_socket) : server_socket_(server_socket) {
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 || listen(listener_, 8) != 0 ||
        getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
      throw std::runtime_error("no relay");
    port_ = ntohs(address.sin_port);
    accepting_ = std::thread([this] { accept_all(); });
  }
  ~Relay() {
    ending_ = true;
    accepting_.join();
    for (std::thread& thread : serving_) thread.join();
    close(listener_);
  }
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  int port() const { return port_; }
  std::atomic<bool> swallows_commit{false};  // the next one; then the connection is closed
  std::atomic<bool> refuses{false};          // new connections

 private:
  void accept_all() {
    pollfd ready{listener_, POLLIN, 0};
    while (!ending_) {
      if (poll(&ready, 1, 20) != 1) continue;
      const int client = accept(listener_, nullptr, nullptr);
      if (refuses)
        close(client);
      else
        serving_.emplace_back([this, client] { serve(client); });
    }
  }

  void serve(int client) {
    const int server = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    server_socket_.copy(address.sun_path, sizeof address.sun_path - 1);
    bool open = connect(server, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    bool swallow = false;
    std::array<pollfd, 2> ends{pollfd{client, POLLIN, 0}, {server, POLLIN, 0}};
    std::array<char, 65536> bytes;
    while (open && !ending_) {
      if (poll(ends.data(), ends.size(), 20) < 1) continue;
      for (std::size_t k = 0; k < 2 && open; ++k) {
        if (ends[k].revents == 0) continue;
        const ssize_t size = read(ends[k].fd, bytes.data(), bytes.size());
        const std::string_view text(bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
        if (k == 0 && text.find("COMMIT") != std::string_view::npos)
          swallow = swallows_commit.exchange(false);
        open = size > 0 && !(k == 1 && swallow) &&
               send(ends[1 - k].fd, text.data(), text.size(), MSG_NOSIGNAL) == size;
      }
    }
    close(server);
    close(client);
  }

  std::string server_socket_;
  int listener_ = -1, port_ = 0;
  std::atomic<bool> ending_{false};
  std::thread accepting_;
  std::vector<std::thread> serving_;
};

class PostgresCommitTest : public PostgresStoreTest {
 protected:
  Result<std::unique_ptr<Store>> open_through(const Relay& relay) const {
    const std::string url = postgres_url(folder_);
    const std::size_t host = url.find("host=") + 5;
    return open_store(url.substr(0, host) + "127.0.0.1&port=" + std::to_string(relay.port()) +
                      url.substr(url.find('&')));
  }
  Relay relay_{postgres_socket()};
  const std::vector<Command> batch_ = {an_event(), ActivateModel{"absent", 1}, an_event()};
};

TEST_F(PostgresCommitTest, UnconfirmedCommitIsNotRepeated) {
  auto store = need(open_through(relay_));
  relay_.swallows_commit = true;
  const auto outcomes = apply_until_done(*store, batch_);
  EXPECT_FALSE(relay_.swallows_commit);
  EXPECT_TRUE(outcomes[0]);
  EXPECT_EQ(outcomes[1].error().fault, Fault::not_found);
  EXPECT_EQ(stored_events(), 2);
}

TEST_F(PostgresCommitTest, ReconnectingSettlesDoubtfulCommits) {
  for (const bool with_others : {false, true}) {
    const std::int64_t before = with_others ? stored_events() : 0;
    auto store = need(open_through(relay_));
    relay_.refuses = true;
    relay_.swallows_commit = true;
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(store->apply(batch_).error().fault, Fault::unavailable);
      EXPECT_TRUE(store->is_in_doubt());
    }
    relay_.refuses = false;
    // Others are applied, since the batch in doubt was done.
    const std::vector<Command> others(5, an_event());
    apply_until_done(*store, with_others ? others : batch_);
    EXPECT_FALSE(store->is_in_doubt());
    EXPECT_EQ(stored_events() - before, with_others ? 7 : 2);
  }
}

TEST_F(PostgresCommitTest, WaitingCallerGetsTheOutcome) {
  auto store = need(open_through(relay_));
  Writer writer(*store, {});
  relay_.refuses = true;
  relay_.swallows_commit = true;
  std::thread server_comes_back([&] {
    while (writer.status().failed_commits < 2) std::this_thread::sleep_for(milliseconds(10));
    relay_.refuses = false;
  });
  EXPECT_TRUE(writer.execute(an_event()));
  server_comes_back.join();
  EXPECT_EQ(stored_events(), 1);
}

TEST_F(PostgresCommitTest, TakenOverStoreAcceptsNoData) {
  auto store = need(open_through(relay_));
  need(store->apply(batch_));
  relay_.refuses = true;
  end_connections();
  EXPECT_FALSE(store->apply(batch_));
  need(need(open())->apply(batch_));
  relay_.refuses = false;
  for (int k = 0; k < 2; ++k) {
    auto refused = store->apply(batch_);
    // The server may notice late that the other program's connection has ended.
    for (int tries = 0; tries < 100 && !refused && refused.error().message.ends_with("that was lost");
         ++tries) {
      std::this_thread::sleep_for(milliseconds(50));
      refused = store->apply(batch_);
    }
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("another joulecast program"), std::string::npos);
  }
  EXPECT_EQ(stored_events(), 4);
}

}  // namespace
}  // namespace joulecast::history
