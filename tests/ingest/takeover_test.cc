// Two daemons of a cluster that receive one robot: one keeps it, the other takes over at any moment. The
// final store equals that of one daemon alone.

#include <gtest/gtest.h>

#include <deque>
#include <functional>

#include "ingest/fleet_view.h"
#include "ingest/keeping.h"
#include "ingest/pipeline.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::ingest {
namespace {

using signals::MissionEvent;
using signals::MissionPhase;
using signals::Sample;

constexpr std::int64_t takeover_start_us = 1'750'000'000'000'000, period_us = 20'000;

InboundMessage takeover_sample(std::int64_t sequence) {
  Sample s;
  s.utime_us = takeover_start_us + sequence * period_us;
  s.sequence = sequence;
  const double swing = std::sin(0.05 * static_cast<double>(sequence));
  s.wheel_velocity_rad_s = {3 + swing, 3 - swing};
  s.battery_voltage_v = 24 - 0.3 * swing;
  s.battery_current_a = 2 + swing;
  s.payload_kg = 2;
  return {"nomad", s, s.utime_us + 1000};
}

InboundMessage takeover_event(MissionPhase phase, std::int64_t sequence, const std::string& id) {
  const MissionEvent e{takeover_start_us + sequence * period_us - 5'000, id, phase, 2, ""};
  return {"nomad", e, e.utime_us + 1000};
}

// Two missions with a moment of rest after each.
std::deque<InboundMessage> drive(std::int64_t samples = 1000, std::int64_t end = 900) {
  std::deque<InboundMessage> messages;
  for (std::int64_t k = 0; k < samples; ++k) {
    if (k == 40) messages.push_back(takeover_event(MissionPhase::started, k, "one"));
    if (k == 400) messages.push_back(takeover_event(MissionPhase::finished, k, "one"));
    if (k == 420) messages.push_back(takeover_event(MissionPhase::started, k, "two"));
    if (k == end) messages.push_back(takeover_event(MissionPhase::finished, k, "two"));
    messages.push_back(takeover_sample(k));
  }
  return messages;
}

// A daemon of the cluster: its pipeline, on the store that all share.
struct Daemon {
  Daemon(history::Store& shared, std::optional<history::StreamPosition>& position, bool knows_model = true,
         std::size_t held_room_bytes = 300'000'000)
      : store(shared),
        pipeline(
            {}, 10, models,
            SessionOutputs{
                shared, [this, &position](history::Command command) { apply(std::move(command), position); },
                fleet, counters, [](const std::string&, const std::string&) {}},
            &keeping, held_room_bytes) {
    if (knows_model) learn_model();
  }

  void learn_model() {
    if (!models.put(testing::nomad(), 1)) throw std::runtime_error("the model");
  }

  // The SQL of leases is tested in tests/history: here the command is applied if it is of the epoch.
  void apply(history::Command command, std::optional<history::StreamPosition>& position) {
    if (away) return;
    if (std::holds_alternative<history::ReleaseLease>(command)) {
      ++releases;
      return;
    }
    const auto fence = history::fence_of(command);
    EXPECT_TRUE(fence) << "a command without an epoch";
    if (const auto* c = std::get_if<history::CheckpointMission>(&command); c != nullptr && c->position)
      position = c->position;
    history::put_under(command, 0);
    const auto done = store.apply({&command, 1});
    ASSERT_TRUE(done && done->front()) << describe(done ? done->front().error() : done.error());
  }

  void handle(const InboundMessage& message) {
    pipeline.follow_orders();
    pipeline.handle(message);
    if (++handled % 25 == 0) pipeline.tick(message.host_utime_us);
  }

  history::Store& store;
  ModelRegistry models;
  FleetView fleet;
  IngestCounters counters;
  Keeping keeping;
  int handled = 0, releases = 0;
  bool away = false;  // its database is unreachable: nothing is stored
  Pipeline pipeline;
};

class TakeoverTest : public ::testing::Test {
 protected:
  std::unique_ptr<history::Store> store(const std::string& name) {
    auto opened = history::open_store(folder_.file(name));
    if (!opened) throw std::runtime_error(describe(opened.error()));
    history::Command model = history::AddModel{"nomad", 1, history::ModelOrigin::file, "", "{}", {}};
    if (!(*opened)->apply({&model, 1})) throw std::runtime_error("the robot");
    return std::move(*opened);
  }

  static std::vector<history::Mission> missions(const history::Store& store) {
    auto page = store.missions({}, {.limit = 100, .cursor = {}},
                               {.by = history::MissionOrder::start, .ascending = true});
    EXPECT_TRUE(page);
    return page ? page->missions : std::vector<history::Mission>{};
  }

  static std::vector<std::int64_t> sequences(const history::Store& store, history::MissionKey key) {
    std::vector<std::int64_t> numbers;
    const auto page = store.telemetry(key, {}, {.limit = 10'000, .cursor = {}});
    EXPECT_TRUE(page);
    for (const Sample& s : page->items) numbers.push_back(s.sequence);
    return numbers;
  }

  void expect_same(const history::Store& one, const history::Store& other) {
    const auto a = missions(one), b = missions(other);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k) {
      EXPECT_EQ(a[k].mission_id, b[k].mission_id);
      EXPECT_EQ(a[k].start_utime_us, b[k].start_utime_us);
      EXPECT_EQ(a[k].end_utime_us, b[k].end_utime_us);
      EXPECT_EQ(a[k].state, b[k].state);
      EXPECT_EQ(a[k].samples, b[k].samples);
      EXPECT_EQ(a[k].gap_count, 0);
      EXPECT_EQ(a[k].sample_faults, b[k].sample_faults);
      EXPECT_EQ(sequences(one, a[k].key), sequences(other, b[k].key));
      EXPECT_DOUBLE_EQ(a[k].accounts.measured_j, b[k].accounts.measured_j);
      EXPECT_NEAR(a[k].accounts.modelled_j, b[k].accounts.modelled_j, 1e-6 * b[k].accounts.modelled_j);
      EXPECT_NEAR(a[k].accounts.duration_s, b[k].accounts.duration_s, 1e-9);
    }
  }

  // One daemon that has it all.
  std::unique_ptr<history::Store> alone(const std::deque<InboundMessage>& messages = drive()) {
    auto there = store("alone.db");
    std::optional<history::StreamPosition> position;
    Daemon daemon(*there, position);
    daemon.keeping.grant({"nomad", 1, {}});
    for (const InboundMessage& message : messages) daemon.handle(message);
    daemon.pipeline.finish();
    return there;
  }

  testing::TemporaryFolder folder_;
};

TEST_F(TakeoverTest, TakeoverIsSeamlessAtAnyMoment) {
  const auto expected = alone();
  ASSERT_EQ(missions(*expected).size(), 4u);  // one implicit before each announced one, and one after
  const auto messages = drive();
  for (std::size_t at = 1; at < messages.size(); at += 37) {
    SCOPED_TRACE("taken over after message " + std::to_string(at));
    const auto shared = store("at-" + std::to_string(at) + ".db");
    std::optional<history::StreamPosition> position;
    Daemon first(*shared, position), second(*shared, position);
    first.keeping.grant({"nomad", 1, {}});
    // The first is killed; until that is detected, messages to the second are not accounted for.
    for (std::size_t k = 0; k < messages.size(); ++k) {
      if (k < at) first.handle(messages[k]);
      if (k == at + 30) second.keeping.grant({"nomad", 2, position});
      second.handle(messages[k]);
    }
    if (at + 30 >= messages.size()) second.keeping.grant({"nomad", 2, position});
    second.pipeline.follow_orders();
    second.pipeline.finish();
    expect_same(*shared, *expected);
    if (HasFailure()) return;
  }
}

TEST_F(TakeoverTest, HandsRobotsOverRepeatedly) {
  const auto expected = alone();
  const auto shared = store("shared.db");
  std::optional<history::StreamPosition> position;
  Daemon one(*shared, position), other(*shared, position);
  Daemon* keeper = &one;
  history::Epoch epoch = 1;
  keeper->keeping.grant({"nomad", epoch, {}});
  int count = 0;
  for (const InboundMessage& message : drive()) {
    one.handle(message);
    other.handle(message);
    if (++count % 90 != 0) continue;
    keeper->keeping.withdraw({"nomad", epoch, true});
    keeper->pipeline.follow_orders();
    EXPECT_EQ(keeper->keeping.epoch_of("nomad"), 0);
    keeper = keeper == &one ? &other : &one;
    keeper->keeping.grant({"nomad", ++epoch, position});
    keeper->pipeline.follow_orders();
  }
  EXPECT_GT(one.releases + other.releases, 10);
  keeper->pipeline.finish();
  expect_same(*shared, *expected);
}

// The second receives all messages from the middle on and ends as soon as it is granted the robot; the third
// starts after the first.
TEST_F(TakeoverTest, EndingDaemonStoresBufferedMessages) {
  const auto expected = alone();
  const auto shared = store("shared.db");
  std::optional<history::StreamPosition> position;
  Daemon first(*shared, position), second(*shared, position), third(*shared, position);
  first.keeping.grant({"nomad", 1, {}});
  const auto messages = drive();
  for (std::size_t k = 0; k < messages.size(); ++k) {
    if (k < 500) first.handle(messages[k]);
    if (k == 500) first.pipeline.suspend();
    if (k < 530) second.handle(messages[k]);
    if (k == 530) {
      second.keeping.grant({"nomad", 2, position});
      second.pipeline.suspend();
      EXPECT_EQ(second.releases, 1);
      third.keeping.grant({"nomad", 3, position});
    }
    if (k >= 530) third.handle(messages[k]);
  }
  third.pipeline.finish();
  expect_same(*shared, *expected);
}

// A robot is added to another daemon shortly before it sends; the lease comes before or after the model.
TEST_F(TakeoverTest, StoresTelemetryBeforeTheModel) {
  const auto expected = alone();
  const auto messages = drive();
  for (const std::size_t granted_at : {45u, 55u}) {
    const auto shared = store("shared-" + std::to_string(granted_at) + ".db");
    std::optional<history::StreamPosition> position;
    Daemon daemon(*shared, position, false);
    for (std::size_t k = 0; k < messages.size(); ++k) {
      if (k == 50) {
        EXPECT_TRUE(daemon.keeping.heard().empty());
        daemon.learn_model();
      }
      if (k == granted_at) daemon.keeping.grant({"nomad", 1, {}});
      daemon.handle(messages[k]);
    }
    EXPECT_EQ(daemon.counters.faults[static_cast<std::size_t>(IngestFault::unknown_robot)], 50u);
    daemon.pipeline.finish();
    expect_same(*shared, *expected);
  }
}

TEST_F(TakeoverTest, DaemonWithoutLeaseStoresNothing) {
  const auto shared = store("shared.db");
  std::optional<history::StreamPosition> position;
  Daemon daemon(*shared, position);
  daemon.keeping.grant({"nomad", 1, {}});
  const auto messages = drive();
  for (std::size_t k = 0; k < 200; ++k) daemon.handle(messages[k]);
  const auto before = missions(*shared);
  daemon.keeping.withdraw({"nomad", 1, false});
  for (std::size_t k = 200; k < 400; ++k) daemon.handle(messages[k]);
  daemon.pipeline.suspend();
  const auto after = missions(*shared);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t k = 0; k < after.size(); ++k) EXPECT_EQ(after[k].samples, before[k].samples);
  EXPECT_EQ(daemon.releases, 0);
}

// The same missions, begun and ended by requests that are stored, of which a daemon hears while it keeps the
// robot.
TEST_F(TakeoverTest, CarriesOutRequestsOnce) {
  const auto expected = alone();
  const auto messages = drive();
  for (std::size_t at = 1; at < messages.size(); at += 61) {
    SCOPED_TRACE("taken over after message " + std::to_string(at));
    const auto shared = store("requests-" + std::to_string(at) + ".db");
    std::optional<history::StreamPosition> position;
    Daemon first(*shared, position), second(*shared, position);
    first.keeping.grant({"nomad", 1, {}});
    std::vector<MissionRequest> requests;
    for (std::size_t k = 0; k < messages.size(); ++k) {
      InboundMessage message = messages[k];
      if (const auto* event = std::get_if<MissionEvent>(&message.content)) {
        requests.push_back({*event, message.host_utime_us});
        const history::Command put =
            history::PutLearned{{"nomad", std::string(mission_request_topic), message.host_utime_us,
                                 mission_requests_json(requests)}};
        ASSERT_TRUE(shared->apply({&put, 1})->front());
        message.content = requests.back();
      }
      if (k < at) first.handle(message);
      if (k == at + 30) second.keeping.grant({"nomad", 2, position});
      second.handle(message);
    }
    if (at + 30 >= messages.size()) second.keeping.grant({"nomad", 2, position});
    second.pipeline.follow_orders();
    second.pipeline.finish();
    expect_same(*shared, *expected);
    if (HasFailure()) return;
  }
}

// The keeper's database is away for longer than anything is kept by its age, and the keeper ends meanwhile.
TEST_F(TakeoverTest, LongOutageLosesNothing) {
  const auto messages = drive(5000, 4000);
  const auto expected = alone(messages);
  const auto shared = store("shared.db");
  std::optional<history::StreamPosition> position;
  Daemon first(*shared, position), second(*shared, position);
  first.keeping.grant({"nomad", 1, {}});
  const auto others = [&] { second.keeping.note_leases({{"nomad", position}}); };
  for (std::size_t k = 0; k < 4900; ++k) {
    first.away = k >= 2500;
    if (!first.away) others();
    if (k < 3500) first.handle(messages[k]);
    second.handle(messages[k]);
  }
  EXPECT_LT(second.keeping.held_messages, 4000u) << "the begin is stored";
  EXPECT_GT(second.keeping.held_messages, 3900u);
  others();
  second.keeping.grant({"nomad", 2, position});
  for (std::size_t k = 4900; k < messages.size(); ++k) second.handle(messages[k]);
  second.pipeline.finish();
  expect_same(*shared, *expected);
}

// The same with room for fewer messages than the outage has: the rest is missing, counted for its mission.
TEST_F(TakeoverTest, CountsMessagesBeyondRoom) {
  const auto messages = drive(5000, 4400);
  const auto expected = alone(messages);
  const auto shared = store("shared.db");
  std::optional<history::StreamPosition> position;
  Daemon first(*shared, position), second(*shared, position, true, 300'000);
  first.keeping.grant({"nomad", 1, {}});
  for (std::size_t k = 0; k < 4900; ++k) {
    first.away = k >= 2500;
    if (!first.away) second.keeping.note_leases({{"nomad", position}});
    if (k < 3500) first.handle(messages[k]);
    second.handle(messages[k]);
  }
  EXPECT_GT(second.keeping.held_dropped, 1000u);
  second.keeping.grant({"nomad", 2, position});
  for (std::size_t k = 4900; k < messages.size(); ++k) second.handle(messages[k]);
  second.pipeline.finish();
  const auto ours = missions(*shared), theirs = missions(*expected);
  ASSERT_EQ(ours.size(), theirs.size());
  for (std::size_t k = 0; k < ours.size(); ++k) {
    const history::Mission &mission = ours[k], &whole = theirs[k];
    EXPECT_EQ(mission.mission_id, whole.mission_id);
    EXPECT_EQ(mission.state, whole.state);
    EXPECT_EQ(mission.samples, static_cast<std::int64_t>(sequences(*shared, mission.key).size()));
    const std::int64_t lost = whole.samples - mission.samples;
    EXPECT_EQ(lost > 0, mission.mission_id == "two");
    const auto counted = mission.sample_faults.find("missing");
    EXPECT_EQ(counted == mission.sample_faults.end() ? 0 : counted->second, lost);
    EXPECT_EQ(mission.incomplete, whole.incomplete || lost > 0);
  }
}

TEST(HeldMessages, FollowTheStoredPosition) {
  HeldMessages held(1'000'000, std::size_t{1} << 20);
  const std::int64_t late_us = takeover_sample(1000).host_utime_us;
  const auto keep = [&held](std::int64_t until) {
    for (std::int64_t k = 0; k < until; ++k) EXPECT_EQ(held.add(takeover_sample(k)), 0u);
  };
  keep(200);
  held.forget_stored(late_us, {{"nomad", history::StreamPosition{takeover_start_us + 150 * period_us, 150}}},
                     false);
  EXPECT_EQ(held.size(), 200u) << "the leases were not read";
  held.forget_stored(late_us, {{"nomad", std::nullopt}}, true);
  EXPECT_EQ(held.size(), 200u) << "nothing is stored";
  held.forget_stored(late_us, {{"nomad", history::StreamPosition{takeover_start_us + 150 * period_us, 150}}},
                     true);
  EXPECT_EQ(held.size(), 100u) << "from a second before the position";
  EXPECT_EQ(std::get<Sample>(held.take("nomad").front().content).sequence, 100);
  EXPECT_EQ(held.bytes(), 0u);
  keep(80);
  held.forget_stored(takeover_sample(80).host_utime_us, {}, false);
  EXPECT_EQ(held.size(), 50u) << "a robot without a lease, by age";
}

TEST(HeldMessages, AreBoundedByBytes) {
  HeldMessages one(1'000'000, std::size_t{1} << 20);
  (void)one.add(takeover_sample(0));
  HeldMessages held(1'000'000, 100 * one.bytes());
  std::size_t gave_way = 0;
  for (std::int64_t k = 0; k < 200; ++k) gave_way += held.add(takeover_sample(k));
  EXPECT_LE(held.bytes(), 100 * one.bytes());
  EXPECT_LE(held.size(), 100u);
  EXPECT_EQ(held.size() + gave_way, 200u);
  const auto last = held.take("nomad");
  EXPECT_EQ(std::get<Sample>(last.back().content).sequence, 199);
  EXPECT_EQ(held.size(), 0u);
}

TEST(SnapshotBytes, KeepEveryMember) {
  RobotSnapshot snapshot;
  snapshot.robot_id = "nomad";
  snapshot.has_model = true;
  snapshot.model_version = 7;
  snapshot.received_utime_us = takeover_start_us;
  snapshot.sample = std::get<Sample>(takeover_sample(3).content);
  snapshot.map = "hall";
  snapshot.level = "2";
  snapshot.mission_id = "one";
  snapshot.accounts.measured_j = 12.5;
  snapshot.accounts.ledger.value[2] = 3.25;
  snapshot.charge.estimate.charge = 0.5;
  snapshot.charge.habit.end_current_a.mean = 0.25;
  snapshot.faults["late"] = 4;
  snapshot.fault_notes["late"] = "why";
  snapshot.contradictions.push_back({ContradictionKind::clock, "id", "channel", 1.5, "says", true, 9});
  const auto bytes = snapshot_bytes(snapshot);
  const auto back = snapshot_from_bytes(bytes);
  ASSERT_NE(back, nullptr);
  EXPECT_EQ(snapshot_bytes(*back), bytes);
  EXPECT_EQ(back->sample.battery_current_a, snapshot.sample.battery_current_a);
  EXPECT_EQ(back->accounts.measured_j, 12.5);
  EXPECT_EQ(back->map + back->level, "hall2");
  EXPECT_EQ(back->contradictions.at(0).says, "says");
  EXPECT_TRUE(back->contradictions.at(0).untrue);
  EXPECT_EQ(back->faults, snapshot.faults);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_EQ(snapshot_from_bytes(std::span(bytes).first(size)), nullptr) << size;
}

}  // namespace
}  // namespace joulecast::ingest
