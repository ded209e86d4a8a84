// A store whose reads block for seconds: the accounting of robots goes on, and what others send meanwhile is
// accounted for afterwards.

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <thread>

#include "ingest/forecasts.h"
#include "ingest/pipeline.h"
#include "tests/history/forwarding_store.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::ingest {
namespace {

using std::chrono::steady_clock;

constexpr std::int64_t blocked_start_us = 1'750'000'000'000'000, blocked_period_us = 20'000;
constexpr auto longest_turn = std::chrono::milliseconds(500);  // less than a read waits for a lock

class BlockedStore final : public history::ForwardingStore {
 public:
  explicit BlockedStore(const std::string& path) : ForwardingStore(open_at(path)) {}
  std::atomic<bool> blocks = false;
  std::atomic<int> waiting = 0;

 protected:
  void before_read() const override {
    auto& self = const_cast<BlockedStore&>(*this);
    ++self.waiting;
    while (blocks) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    --self.waiting;
  }
};

class BlockedStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const std::string id : {"old", "new"}) {
      robot::RobotModel robot = testing::nomad();
      robot.robot_id = id;
      apply(history::AddModel{id, 1, history::ModelOrigin::file, "", robot::to_json_text(robot), {}});
      ASSERT_TRUE(models_.put(robot, 1));
    }
  }

  void apply(history::Command command) {
    const auto done = store_.apply({&command, 1});
    ASSERT_TRUE(done && done->front()) << describe(done ? done->front().error() : done.error());
  }

  // A turn of the accounting thread; none may wait for the store.
  void handle(const InboundMessage& message) {
    const auto began = steady_clock::now();
    pipeline_.follow_orders();
    pipeline_.handle(message);
    if (std::holds_alternative<signals::Sample>(message.content)) pipeline_.tick(message.host_utime_us);
    for (const auto& robot : fleet_.all())
      if (const auto model = models_.find(robot->robot_id)) (void)forecasts_.live_reach(model, *robot);
    slowest_ = std::max(slowest_, steady_clock::now() - began);
  }

  void send(const std::string& robot_id, signals::MissionPhase phase, std::int64_t at,
            const std::string& id) {
    const std::int64_t utime_us = blocked_start_us + at * blocked_period_us;
    handle({robot_id, signals::MissionEvent{utime_us, id, phase, 2, ""}, utime_us + 1000});
  }

  void drive(const std::string& robot_id, std::int64_t from, std::int64_t to, const std::string& id) {
    send(robot_id, signals::MissionPhase::started, from, id);
    for (std::int64_t k = from; k < to; ++k) {
      signals::Sample s;
      s.utime_us = blocked_start_us + k * blocked_period_us;
      s.sequence = sequence_[robot_id]++;
      s.wheel_velocity_rad_s = {3, 3};
      s.battery_voltage_v = 24;
      s.battery_current_a = 2;
      s.payload_kg = 2;
      handle({robot_id, s, s.utime_us + 1000});
    }
    send(robot_id, signals::MissionPhase::finished, to, id);
  }

  void until(const std::function<bool()>& condition) {
    const auto began = steady_clock::now();
    while (!condition() && steady_clock::now() - began < std::chrono::seconds(20)) {
      pipeline_.follow_orders();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_TRUE(condition());
  }

  // Mission ids and samples, by start.
  std::map<std::string, std::int64_t> samples(const std::string& robot_id) const {
    std::map<std::string, std::int64_t> found;
    history::MissionFilter of_robot;
    of_robot.robot_ids = {robot_id};
    const auto page = store_.missions(of_robot, {.limit = 100, .cursor = {}}, {});
    EXPECT_TRUE(page);
    for (const history::Mission& mission : page->missions) found[mission.mission_id] = mission.samples;
    return found;
  }

  testing::TemporaryFolder folder_;
  BlockedStore store_{folder_.file("history.db")};
  ModelRegistry models_;
  FleetView fleet_;
  IngestCounters counters_;
  Forecasts forecasts_{store_};
  std::map<std::string, std::int64_t> sequence_;
  steady_clock::duration slowest_{};
  SessionOutputs outputs_{
      store_,
      [this](history::Command command) { apply(std::move(command)); },
      fleet_,
      counters_,
      [](const std::string&, const std::string& text) { ADD_FAILURE() << text; },
      [this](const SessionOutputs::Post& post, const std::shared_ptr<const ModelInForce>& model,
             forecast::PastMission mission) {
        post(history::PutLearned{forecasts_.learn(model, std::move(mission))});
      },
      {},
      {},
      [this](const std::string& robot_id) { return forecasts_.read(models_.find(robot_id)); }};
  Pipeline pipeline_{{}, 10, models_, outputs_};
};

TEST_F(BlockedStoreTest, AccountingGoesOn) {
  pipeline_.start_reading();
  drive("old", 0, 50, "first");
  until([&] { return counters_.samples == 50; });
  slowest_ = {};

  store_.blocks = true;
  drive("new", 100, 150, "first");  // nothing is known of it
  drive("old", 100, 150, "second");
  drive("new", 200, 250, "second");
  drive("old", 400, 450, "first");  // the name of an earlier one
  EXPECT_GT(store_.waiting, 0);
  EXPECT_EQ(counters_.samples, 150U);
  std::this_thread::sleep_for(std::chrono::seconds(1));
  drive("old", 500, 550, "third");
  EXPECT_EQ(counters_.samples, 200U);
  EXPECT_LT(slowest_, longest_turn);

  store_.blocks = false;
  until([&] { return counters_.samples == 300; });
  pipeline_.suspend();
  // A name that is used again is another mission.
  EXPECT_EQ(samples("old"),
            (std::map<std::string, std::int64_t>{{"first", 50}, {"second", 50}, {"third", 50}}));
  EXPECT_EQ(samples("new"), (std::map<std::string, std::int64_t>{{"first", 50}, {"second", 50}}));
  EXPECT_EQ(store_.missions({}, {.limit = 100, .cursor = {}}, {})->missions.size(), 6U);
  EXPECT_EQ(counters_.faults[static_cast<std::size_t>(IngestFault::missing)], 0U);
}

TEST_F(BlockedStoreTest, StopAccountsForWaitingRobots) {
  pipeline_.start_reading();
  store_.blocks = true;
  drive("new", 0, 50, "first");
  EXPECT_EQ(counters_.samples, 0U);
  std::thread soon([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    store_.blocks = false;
  });
  pipeline_.suspend();
  soon.join();
  EXPECT_EQ(counters_.samples, 50U);
  EXPECT_EQ(samples("new"), (std::map<std::string, std::int64_t>{{"first", 50}}));
}

}  // namespace
}  // namespace joulecast::ingest
