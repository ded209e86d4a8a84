// Daemons that share a PostgreSQL: leases, commits under a lost lease, keys, live state.

#include "history/leases.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <set>
#include <thread>

#include "history/open_store.h"
#include "history/postgres.h"
#include "history/spool.h"
#include "history/writer.h"
#include "postgres_server.h"

namespace joulecast::history {
namespace {

using std::chrono::milliseconds;

class LeasesTest : public ::testing::Test {
 protected:
  struct Daemon {
    std::string writer = new_writer_name();
    std::unique_ptr<Store> store;
    std::unique_ptr<Leases> leases;
    std::map<std::string, std::uint64_t> dropped;
  };

  std::unique_ptr<Daemon> daemon(const std::string& node, milliseconds lifetime = milliseconds(5000)) {
    auto made = std::make_unique<Daemon>();
    made->store = need(open_store(
        url(),
        {.shared_writer = made->writer,
         .on_dropped = [&dropped = made->dropped](const std::string& robot_id, Epoch, std::uint64_t count) {
           dropped[robot_id] += count;
         }}));
    made->leases = std::make_unique<Leases>(
        LeaseOptions{url(), "test", node, "http://" + node, "1", made->writer, lifetime});
    need_done(made->leases->join());
    return made;
  }

  static void need_done(const Result<void>& result) {
    if (!result) throw std::runtime_error(describe(result.error()));
  }

  static Lease lease_of(Leases& leases, const std::string& robot_id) {
    for (Lease& lease : need(leases.state()).leases)
      if (lease.robot_id == robot_id) return lease;
    Lease none;
    none.robot_id = robot_id;
    return none;
  }

  static std::vector<Lease> take(Leases& leases, const std::string& robot_id) {
    return need(leases.take({lease_of(leases, robot_id)}));
  }

  static Result<std::vector<Outcome>> checkpoint(Store& store, Mission& mission, Epoch epoch,
                                                 std::int64_t sequence) {
    CheckpointMission command{mission, {}, some_samples(mission.start_utime_us + sequence, sequence, 1), {}};
    command.position = StreamPosition{mission.start_utime_us + sequence, sequence};
    command.epoch = epoch;
    command.mission.samples = ++mission.samples;
    const Command commands[] = {command};
    return store.apply(commands);
  }

  std::string url() const { return postgres_url(folder_); }
  std::string administer(const std::string& sql) const { return as_administrator(folder_, sql); }
  void TearDown() override { start_postgres(); }

  TemporaryFolder folder_;
};

TEST_F(LeasesTest, OneDaemonTakesTheLease) {
  const auto a = daemon("a"), b = daemon("b");
  const Lease seen_by_b = lease_of(*b->leases, "nomad");
  const auto taken = take(*a->leases, "nomad");
  ASSERT_EQ(taken.size(), 1u);
  EXPECT_EQ(taken[0].node, "a");
  EXPECT_EQ(taken[0].epoch, 1);
  EXPECT_TRUE(need(b->leases->take({seen_by_b})).empty());
  EXPECT_TRUE(take(*b->leases, "nomad").empty());
  need_done(a->leases->free(taken));
  const auto next = take(*b->leases, "nomad");
  ASSERT_EQ(next.size(), 1u);
  EXPECT_EQ(next[0].epoch, 2);
  EXPECT_EQ(next[0].takeovers, 0);
}

TEST_F(LeasesTest, CommitUnderLostLeaseIsDropped) {
  const auto a = daemon("a", milliseconds(200)), b = daemon("b");
  const Epoch of_a = take(*a->leases, "nomad").at(0).epoch;
  Mission mission = new_mission(*a->store, "nomad", "m", 1'000'000);
  StartMission start{mission, of_a};
  need(apply_one(*a->store, start));
  ASSERT_TRUE(checkpoint(*a->store, mission, of_a, 1));
  EXPECT_EQ(lease_of(*b->leases, "nomad").position, (StreamPosition{1'000'001, 1}));

  // a is paused: it does not renew.
  std::this_thread::sleep_for(milliseconds(300));
  EXPECT_TRUE(take(*b->leases, "nomad").empty()) << "its membership was not ended yet";
  for (const Member& member : need(b->leases->state()).members)
    if (member.node == "a") {
      EXPECT_TRUE(need(b->leases->bury(member)));
    }
  const auto taken = take(*b->leases, "nomad");
  ASSERT_EQ(taken.size(), 1u);
  EXPECT_EQ(taken[0].takeovers, 1);
  EXPECT_EQ(taken[0].position, (StreamPosition{1'000'001, 1}));

  Mission same = mission;
  Result<std::vector<Outcome>> late = checkpoint(*a->store, mission, of_a, 2);
  for (int tries = 0; !late && tries < 100; ++tries) {  // its connection was ended
    std::this_thread::sleep_for(milliseconds(20));
    late = checkpoint(*a->store, mission, of_a, 2);
  }
  ASSERT_TRUE(late) << describe(late.error());
  EXPECT_EQ(a->dropped["nomad"], 1u);
  ASSERT_TRUE(checkpoint(*b->store, same, taken[0].epoch, 3));
  EXPECT_TRUE(b->dropped.empty());
  const auto stored = need(b->store->telemetry(mission.key, {}, {.limit = 100, .cursor = {}}));
  ASSERT_EQ(stored.items.size(), 2u);
  EXPECT_EQ(stored.items[1].sequence, 3);
  EXPECT_EQ(a->leases->renew().error().fault, Fault::conflict);
}

TEST_F(LeasesTest, FencedSpoolKeepsMissingSamples) {
  auto a = daemon("a");
  const auto b = daemon("b");
  const Epoch of_a = take(*a->leases, "nomad").at(0).epoch;
  Mission mission = new_mission(*a->store, "nomad", "m", 1'000'000);
  need(apply_one(*a->store, StartMission{mission, of_a}));
  ASSERT_TRUE(checkpoint(*a->store, mission, of_a, 1));
  CheckpointMission late{mission, {}, {}, {}};
  for (const std::int64_t k : {2, 3, 4, 9}) {
    const auto one = some_samples(mission.start_utime_us + k, k, 1);
    late.samples.insert(late.samples.end(), one.begin(), one.end());
  }
  late.epoch = of_a;
  const Command spooled = late;
  const Command* commands[] = {&spooled};
  const std::string path = folder_.file("a.spool");
  need_done(write_spool(path, TakeSpool{{}, a->store->mark()}, commands));
  need_done(a->leases->leave());
  a.reset();

  // The other daemon did not receive 2 and 4.
  const Epoch of_b = take(*b->leases, "nomad").at(0).epoch;
  ASSERT_TRUE(checkpoint(*b->store, mission, of_b, 3));
  ASSERT_TRUE(checkpoint(*b->store, mission, of_b, 5));
  a = daemon("a");
  const TakenSpool taken =
      need(take_in_spool(path, *a->store, [](const Error& error) { ADD_FAILURE() << describe(error); }));
  EXPECT_EQ(taken.fenced, 1U);
  EXPECT_EQ(taken.samples, 2U) << "3 is stored, and 9 may come from the robot's keeper yet";
  EXPECT_EQ(taken.kept_as, path + ".refused-1");
  EXPECT_EQ(a->dropped["nomad"], 1U);
  ASSERT_TRUE(checkpoint(*b->store, mission, of_b, 6));
  std::vector<std::int64_t> sequences;
  for (const auto& sample : need(b->store->telemetry(mission.key, {}, {.limit = 100, .cursor = {}})).items)
    sequences.push_back(sample.sequence);
  EXPECT_THAT(sequences, ::testing::ElementsAre(1, 3, 5, 2, 4, 6));
  EXPECT_EQ(need(b->store->mission(mission.key)).samples, 4) << "the accounts stay those of the keepers";
  EXPECT_EQ(administer("SELECT telemetry_samples::text FROM mission"), "6");
}

TEST_F(LeasesTest, AbandonedTransactionBlocksNothing) {
  const auto a = daemon("a", milliseconds(200)), b = daemon("b");
  (void)take(*a->leases, "nomad");
  // As a daemon leaves it that is stopped within a commit.
  PostgresDatabase stuck(url(), a->writer);
  stuck.begin(Database::Access::write);
  stuck.execute("SELECT * FROM cluster_lease WHERE robot_id = 'nomad' FOR NO KEY UPDATE");
  std::this_thread::sleep_for(milliseconds(300));
  for (const Member& member : need(b->leases->state()).members)
    if (member.node == "a") {
      EXPECT_TRUE(need(b->leases->bury(member)));
    }
  EXPECT_EQ(take(*b->leases, "nomad").size(), 1u);
}

TEST_F(LeasesTest, RenewedMembershipSurvives) {
  const auto a = daemon("a", milliseconds(300)), b = daemon("b");
  std::this_thread::sleep_for(milliseconds(400));
  const auto seen = need(b->leases->state()).members;
  need_done(a->leases->renew());
  for (const Member& member : seen)
    if (member.node == "a") {
      EXPECT_FALSE(need(b->leases->bury(member)));
    }
  need_done(a->leases->renew());
}

TEST_F(LeasesTest, NamesAreChecked) {
  const auto a = daemon("a");
  auto twin = std::make_unique<Leases>(
      LeaseOptions{url(), "test", "a", "", "1", new_writer_name(), milliseconds(5000)});
  EXPECT_EQ(twin->join().error().field, "cluster.node");
  auto other = std::make_unique<Leases>(
      LeaseOptions{url(), "other", "b", "", "1", new_writer_name(), milliseconds(5000)});
  EXPECT_EQ(other->join().error().field, "cluster.name");
}

TEST_F(LeasesTest, ReleaseFollowsEarlierCommands) {
  const auto a = daemon("a"), b = daemon("b");
  const Epoch epoch = take(*a->leases, "nomad").at(0).epoch;
  Mission mission = new_mission(*a->store, "nomad", "m", 1'000'000);
  Writer writer(*a->store, {});
  ASSERT_TRUE(writer.post(StartMission{mission, epoch}));
  for (std::int64_t k = 0; k < 50; ++k) {
    CheckpointMission each{mission, {}, some_samples(1'000'000 + k, k, 1), {}};
    each.epoch = epoch;
    each.position = StreamPosition{1'000'000 + k, k};
    ASSERT_TRUE(writer.offer(std::move(each)));
  }
  ASSERT_TRUE(writer.post(ReleaseLease{"nomad", epoch}));
  ASSERT_TRUE(writer.flush());
  const auto taken = take(*b->leases, "nomad");
  ASSERT_EQ(taken.size(), 1u);
  EXPECT_EQ(taken[0].position, (StreamPosition{1'000'049, 49}));
  EXPECT_EQ(need(b->store->telemetry(mission.key, {}, {.limit = 100, .cursor = {}})).items.size(), 50u);
}

TEST_F(LeasesTest, MissionKeysAreUnique) {
  const auto a = daemon("a"), b = daemon("b");
  std::set<MissionKey> keys;
  for (std::int64_t k = 0; k < 2500; ++k) {
    for (Store* each : {a->store.get(), b->store.get()}) {
      keys.insert(need(each->new_mission_key()));
      if (k % 500 == 0) need(each->apply({}));
    }
  }
  EXPECT_EQ(keys.size(), 5000u);
  // While the database is away, too.
  stop_postgres();
  for (std::int64_t k = 0; k < 500; ++k) keys.insert(need(a->store->new_mission_key()));
  EXPECT_EQ(keys.size(), 5500u);
}

TEST_F(LeasesTest, DaemonsCommitConcurrently) {
  const auto a = daemon("a"), b = daemon("b");
  constexpr int each = 40;
  const auto work = [](Store& store, const std::string& robot_id) {
    for (int k = 0; k < each; ++k) {
      const Command commands[] = {
          AppendAudit{{0, k, "somebody", "", "", "test", "{}", ""}},
          AddModel{
              "shared", k, ModelOrigin::http, "", "{\"of\": \"" + robot_id + std::to_string(k) + "\"}", {}},
          AppendEvent{{0, k, robot_id, "test", "{}"}}};
      for (int tries = 0;; ++tries) {  // as the writer does: a deadlock ends one of the two
        const auto outcomes = store.apply(commands);
        if (outcomes) {
          for (const Outcome& outcome : *outcomes) EXPECT_TRUE(outcome) << describe(outcome.error());
          break;
        }
        ASSERT_LT(tries, 100) << describe(outcomes.error());
      }
    }
  };
  std::thread other([&] { work(*b->store, "b"); });
  work(*a->store, "a");
  other.join();
  EXPECT_EQ(administer("SELECT count(*)::text FROM event"), std::to_string(2 * each));
  EXPECT_EQ(administer("SELECT count(*) || ' ' || max(audit_id) FROM audit"),
            std::to_string(2 * each) + " " + std::to_string(2 * each));
  EXPECT_EQ(administer("SELECT count(*) || ' ' || max(version) FROM model"),
            std::to_string(2 * each) + " " + std::to_string(2 * each));
}

TEST_F(LeasesTest, SharedAndExclusiveUseConflict) {
  {
    const auto a = daemon("a");
    const auto refused = open_store(url(), {.lock_wait = milliseconds(200)});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().fault, Fault::conflict);
  }
  const auto alone = need(open_store(url()));
  const auto refused = open_store(url(), {.shared_writer = new_writer_name()});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::conflict);
}

TEST_F(LeasesTest, AbandonedDiagnosesAreTakenOnce) {
  auto a = daemon("a", milliseconds(200));
  const auto b = daemon("b"), c = daemon("c");
  need(apply_one(*a->store, PutLearned{{"nomad", "t", 1, "{}"}}));
  DiagnosisRecord record;
  record.robot_id = "nomad";
  record.request_json = "{}";
  record.id = need(apply_one(*a->store, AddDiagnosis{record}));
  EXPECT_TRUE(need(b->leases->take_jobs()).empty());
  std::this_thread::sleep_for(milliseconds(300));
  for (const Member& member : need(b->leases->state()).members)
    if (member.node == "a") {
      EXPECT_TRUE(need(b->leases->bury(member)));
    }
  EXPECT_THAT(need(b->leases->take_jobs()), ::testing::ElementsAre(record.id));
  EXPECT_TRUE(need(c->leases->take_jobs()).empty());
  record.state = DiagnosisState::done;
  const auto late = [&] { return a->store->apply(std::vector<Command>{UpdateDiagnosis{record, ""}}); };
  auto outcomes = late();
  for (int tries = 0; !outcomes && tries < 100; ++tries) {
    std::this_thread::sleep_for(milliseconds(20));
    outcomes = late();
  }
  ASSERT_TRUE(outcomes);
  EXPECT_EQ(outcomes->front().error().fault, Fault::conflict);
  EXPECT_TRUE(apply_one(*b->store, UpdateDiagnosis{record, ""}));
}

TEST_F(LeasesTest, LiveStatesAreReceivedOnce) {
  const auto a = daemon("a");
  const auto of_a = std::make_unique<SharedState>(url(), "test-a"),
             of_b = std::make_unique<SharedState>(url(), "test-b");
  const auto body = [](char c) { return std::vector<std::byte>(3, static_cast<std::byte>(c)); };
  need_done(of_a->put({{"nomad", "a", 2, body('x')}, {"tug", "a", 2, body('y')}}));
  EXPECT_EQ(need(of_b->news("b")).size(), 2u);
  EXPECT_TRUE(need(of_b->news("b")).empty());
  EXPECT_TRUE(need(of_a->news("a")).empty());
  need_done(of_a->put({{"nomad", "a", 2, body('z')}}));
  const auto news = need(of_b->news("b"));
  ASSERT_EQ(news.size(), 1u);
  EXPECT_EQ(news[0].body, body('z'));
  // An earlier keeper's does not replace a later one's.
  need_done(of_b->put({{"nomad", "b", 3, body('b')}}));
  need_done(of_a->put({{"nomad", "a", 2, body('a')}}));
  const auto latest = need(of_a->news("a"));
  ASSERT_EQ(latest.size(), 1u);
  EXPECT_EQ(latest[0].node, "b");
}

}  // namespace
}  // namespace joulecast::history
